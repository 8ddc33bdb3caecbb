"""`stagectl status`: the state of the axes, in plain words."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import click

from stagectl.cli.bus_access import Bench
from stagectl.cli.options import JSON_OUT, takes
from stagectl.cli.terminal import make_table, show_result

if TYPE_CHECKING:
    from rich.table import Table

    from drivers.commissioning import AxisStatus

_LISTEN = 0.25  # two heartbeats [s]


@click.command
@takes(Bench)
@JSON_OUT
def command(bench: Bench, json_out: Path | None) -> None:
    """Read state, mode, position, force and errors of all axes; nothing is changed.

    Positions count from the drive's zero, which is the stage's zero only after homing. Can be used
    while another host runs the stage, unless that host uses SDO at the same moment.
    """
    from drivers.commissioning import status_of
    from drivers.drive import Axis

    with bench.observer() as network:
        axes = [Axis(network, settings) for settings in bench.axes]
        network.pump(_LISTEN)
        statuses = [status_of(axis) for axis in axes]
        for axis in axes:
            axis.node.detach()
    values = {}
    for status in statuses:
        entry = {**asdict(status), "state": str(status.state)}
        values[entry.pop("axis")] = entry
    show_result(values, json_out, _table(statuses, bench.machine.name))


def _table(statuses: list[AxisStatus], machine: str) -> Table:
    from drivers.commissioning import error_line

    titles = ("axis", "node", "NMT", "status", "mode", "position", "force", "errors")
    rows = [
        (
            s.axis, str(s.node), s.nmt or "no heartbeat",
            f"{s.words} (0x{s.statusword:04X}, {s.state})", s.mode_text,
            "-" if s.position is None else f"{s.position * 1e3:.6f} mm",
            "-" if s.force is None else f"{s.force:.2f} N", error_line(s),
        )
        for s in statuses
    ]  # fmt: skip
    return make_table(f"Status of {machine}", titles, rows, ("node", "position", "force"))
