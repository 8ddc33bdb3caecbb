"""`stagectl observer`: the settling observer of each axis, as a run designs it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from stagectl.cli.console import make_console
from stagectl.cli.options import FILE, JSON_OUT, NumberRange, is_json_on_stdout, write_json

if TYPE_CHECKING:
    from estimation.observer import Design


@click.command
@click.option("--machine", type=FILE, help="Machine file of the stage.  [default: wafer-xy]")
@click.option(
    "--friction-scale",
    type=NumberRange(0.01, 100.0),
    default=1.0,
    show_default=True,
    help="Machine file's friction parameters times this factor, as in a run.",
)
@JSON_OUT
def command(machine: Path | None, friction_scale: float, json_out: Path | None) -> None:
    """Design the settling observer of each axis and print its gain and safety margins.

    Between two SYNCs the observer estimates, from the position, the force that the axis lacks, and
    moves the force offset towards it by the share GAIN per SYNC. The gain is the largest that keeps
    the peak sensitivity of the whole loop at or below 2, or 1.1 times that of the drive alone if
    that is more. It holds for offsets that take effect one or two SYNCs after the sample, for
    slipping friction, presliding stiffness and viscous friction off by 50 %, a mass off by three
    times plant.tolerance, and the effects in the machine file. Nothing moves.

    A run uses it by default (--no-observer does without). An axis goes without where its drive has
    no force offset (0x60B2), where the machine file says `observer: none`, or where the drive's
    loops are a cascade.
    """
    from stagectl.config import load_machine
    from stagectl.config.settings.observer import design_observers

    stage = load_machine(machine)
    designs = design_observers(
        stage,
        {
            name: axis.plant.friction.figures.scaled(friction_scale)
            for name, axis in stage.axes.items()
        },
    )
    write_json({"axes": {name: _figures(found) for name, found in designs.items()}}, json_out)
    if not is_json_on_stdout(json_out):
        make_console().print(_table(designs, stage.name))


def _figures(found: Design | str) -> dict[str, Any]:
    if isinstance(found, str):
        return {"on": False, "reason": found}
    first, second = found.peaks
    return {
        "on": True,
        "gain": found.gain,
        "time_constant": found.time_constant,
        "limit": found.figures.limit,
        "assumed_stiffness": found.assumed_stiffness,
        "sensitivity_peak": {
            "drive_alone": found.drive_peak,
            "latency_1": first,
            "latency_2": second,
            "worst": found.worst_peak,
        },
    }


def _table(designs: dict[str, Design | str], name: str) -> Any:
    from rich.table import Table

    table = Table(title=f"{name}: settling observer", title_justify="left")
    table.add_column("")
    for axis in designs:
        table.add_column(axis, justify="right")
    rows = [_figures(found) for found in designs.values()]
    table.add_row("observer", *("on" if r["on"] else r["reason"] for r in rows))

    def add(label: str, *keys: str, scale: float = 1.0, form: str = ".3g") -> None:
        cells = []
        for figures in rows:
            value: Any = figures
            for key in keys:
                value = value.get(key) if value is not None else None
            cells.append("" if value is None else format(value * scale, form))
        table.add_row(label, *cells)

    add("gain per SYNC", "gain")
    add("time constant, ms", "time_constant", scale=1e3)
    add("limit of the correction, N", "limit")
    add("assumed stiffness, N/m", "assumed_stiffness")
    table.add_section()
    peak = "sensitivity_peak"
    add("peak sensitivity: drive alone", peak, "drive_alone", form=".2f")
    add("  offset 1 SYNC after the sample", peak, "latency_1", form=".2f")
    add("  offset 2 SYNCs after the sample", peak, "latency_2", form=".2f")
    add("  worst, with figures off", peak, "worst", form=".2f")
    return table
