"""`stagectl bus-budget`: do the PDOs fit into the SYNC period at this bit rate?"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from stagectl.cli.console import make_console
from stagectl.cli.options import FILE, JSON_OUT, NumberRange, is_json_on_stdout, write_json

if TYPE_CHECKING:
    from drivers.commissioning import BusBudget

_BYTES = click.IntRange(0, 8)


@click.command
@click.option("--machine", type=FILE, help="Machine file of the stage.  [default: wafer-xy]")
@click.option(
    "--sync-period",
    type=NumberRange(1e-6, 10),
    help="SYNC period [s].  [default: the machine file's]",
)
@click.option(
    "--bitrate",
    type=click.IntRange(10_000, 1_000_000),
    help="Bit rate [bit/s].  [default: the machine file's]",
)
@click.option(
    "--rpdo",
    type=_BYTES,
    multiple=True,
    help="Bytes of an RPDO of each axis; repeat for several.  [default: 8]",
)
@click.option(
    "--tpdo",
    type=_BYTES,
    multiple=True,
    help="Bytes of a TPDO of each axis; repeat for several.  [default: 8]",
)
@click.option("--sync-counter", is_flag=True, help="SYNC carries a counter (0x1019).")
@JSON_OUT
def command(
    machine: Path | None, sync_period: float | None, bitrate: int | None,
    rpdo: tuple[int, ...], tpdo: tuple[int, ...], sync_counter: bool, json_out: Path | None,
) -> None:  # fmt: skip
    """Add up the bits of one SYNC period with worst-case bit stuffing, and what is left for SDO.

    Exit code 0 if the worst cycle fits, 1 if not. This is arithmetic: no bus is opened.
    """
    from drivers.commissioning import stage_budget
    from stagectl.config import load_machine
    from stagectl.errors import StagectlError

    stage = load_machine(machine)
    budget = stage_budget(
        tuple(stage.axes),
        rpdo or (8,),
        tpdo or (8,),
        sync_period or stage.bus.sync_period,
        bitrate or stage.bus.bitrate,
        int(sync_counter),
    )
    write_json(_figures(budget), json_out)
    if not is_json_on_stdout(json_out):
        make_console().print(_table(budget, stage.name))
        _verdict(budget)
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


def _table(budget: BusBudget, name: str) -> Any:
    from rich.table import Table

    table = Table(
        title=f"{name}: SYNC {budget.sync_period * 1e3:g} ms, {budget.bitrate / 1e3:g} kbit/s",
        title_justify="left",
    )
    for column in ("frame", "bytes", "bits, worst", "bits, no stuffing", "share, worst"):
        table.add_column(column, justify="left" if column == "frame" else "right")
    rows = [(x.name, str(x.data_bytes), x.worst, x.least) for x in budget.lines]
    rows.append(("cyclic frames", "", budget.worst, budget.least))
    rows.append((f"worst cycle, with {budget.heartbeats} heartbeats", "", budget.peak, -1))
    for label, size, worst, least in rows:
        if label == "cyclic frames":
            table.add_section()
        table.add_row(
            label, size, str(worst), "" if least < 0 else str(least),
            f"{100 * worst / budget.available:.1f} %",
        )  # fmt: skip
    return table


def _verdict(budget: BusBudget) -> None:
    if not budget.fits:
        click.echo(f"shortest SYNC period that fits: {budget.shortest_period * 1e3:.3f} ms")
        return
    click.echo(
        f"left for SDO: {budget.sdo_pairs} request/answer pairs in the worst cycle, "
        f"{budget.sdo_per_second:.0f} per second on average"
    )
    if budget.sdo_pairs == 0:
        click.echo("an SDO in the worst cycle delays it: do not poll by SDO while streaming")
