"""`stagectl bus-budget`: do the PDOs fit into the SYNC period at this bit rate?"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from stagectl.cli.options import FILE, JSON_OUT, NumberRange, option, takes
from stagectl.cli.terminal import make_table, show_result
from stagectl.errors import StagectlError

if TYPE_CHECKING:
    from rich.table import Table

    from drivers.commissioning import BusBudget

_BYTES = click.IntRange(0, 8)


@dataclass(frozen=True)
class _CycleOptions:
    """Of one SYNC period; where they are not given, as in the machine file."""

    machine: Path | None = option("Machine file of the stage.  [default: wafer-xy]", FILE)
    sync_period: float | None = option(
        "SYNC period [s].  [default: the machine file's]", NumberRange(1e-6, 10)
    )
    bitrate: int | None = option(
        "Bit rate [bit/s].  [default: the machine file's]", click.IntRange(10_000, 1_000_000)
    )
    rpdo: tuple[int, ...] = option(
        "Bytes of an RPDO of each axis; repeat for several.  [default: 8]", _BYTES, multiple=True
    )
    tpdo: tuple[int, ...] = option(
        "Bytes of a TPDO of each axis; repeat for several.  [default: 8]", _BYTES, multiple=True
    )
    sync_counter: bool = option("SYNC carries a counter (0x1019).", default=False)


@click.command
@takes(_CycleOptions)
@JSON_OUT
def command(cycle: _CycleOptions, json_out: Path | None) -> None:
    """Add up the bits of one SYNC period with worst-case bit stuffing, and what is left for SDO.

    Exit code 0 if the worst cycle fits, 1 if not. This is arithmetic: no bus is opened.
    """
    from drivers.commissioning import stage_budget
    from stagectl.config import load_machine

    stage = load_machine(cycle.machine)
    budget = stage_budget(
        tuple(stage.axes),
        cycle.rpdo or (8,),
        cycle.tpdo or (8,),
        cycle.sync_period or stage.bus.sync_period,
        cycle.bitrate or stage.bus.bitrate,
        int(cycle.sync_counter),
    )
    show_result(_figures(budget), json_out, _table(budget, stage.name), *_verdict(budget))
    if not budget.fits:
        raise StagectlError(
            f"the worst cycle needs {budget.peak} bits, but {budget.available} fit into "
            f"{budget.sync_period * 1e3:g} ms at {budget.bitrate / 1e3:g} kbit/s"
        )


def _figures(budget: BusBudget) -> dict[str, Any]:
    return {
        "sync_period": budget.sync_period, "bitrate": budget.bitrate,
        "frames": [
            {"name": x.name, "count": 1, "bytes": x.data_bytes, "bits_worst": x.worst,
             "bits_least": x.least}
            for x in budget.lines
        ],
        "bits_available": budget.available, "bits_worst": budget.worst,
        "bits_least": budget.least, "bits_worst_with_heartbeats": budget.peak,
        "fits": budget.fits, "sdo_pairs_in_worst_cycle": budget.sdo_pairs,
        "sdo_per_second": budget.sdo_per_second, "shortest_sync_period": budget.shortest_period,
    }  # fmt: skip


def _table(budget: BusBudget, name: str) -> Table:
    def row(label: str, size: str, worst: int, least: str) -> tuple[str, ...]:
        return label, size, str(worst), least, f"{100 * worst / budget.available:.1f} %"

    titles = ("frame", "bytes", "bits, worst", "bits, no stuffing", "share, worst")
    heartbeats = f"worst cycle, with {budget.heartbeats} heartbeats"
    rows = [
        *(row(x.name, str(x.data_bytes), x.worst, str(x.least)) for x in budget.lines),
        None,
        row("cyclic frames", "", budget.worst, str(budget.least)),
        row(heartbeats, "", budget.peak, ""),
    ]
    title = f"{name}: SYNC {budget.sync_period * 1e3:g} ms, {budget.bitrate / 1e3:g} kbit/s"
    return make_table(title, titles, rows, titles[1:])


def _verdict(budget: BusBudget) -> list[str]:
    if not budget.fits:
        return [f"shortest SYNC period that fits: {budget.shortest_period * 1e3:.3f} ms"]
    left = (
        f"left for SDO: {budget.sdo_pairs} request/answer pairs in the worst cycle, "
        f"{budget.sdo_per_second:.0f} per second on average"
    )
    if budget.sdo_pairs:
        return [left]
    return [left, "an SDO in the worst cycle delays it: do not poll by SDO while streaming"]
