"""`stagectl check`: does a drive behave as CiA 402 says?"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from stagectl.cli.bus_access import Bench, bus_options, interruptible
from stagectl.cli.options import JSON_FILE, quietly, write_json

if TYPE_CHECKING:
    from drivers.bench.conformance import Finding


@click.command(short_help="Does a drive behave as CiA 402 says?")
@click.argument("node", type=click.IntRange(1, 126))
@bus_options
@click.option("--power/--no-power", default=True, show_default=True,
              help="Also what needs the axis under force.")  # fmt: skip
@click.option("--homing", is_flag=True,
              help="Also home at the present position: the drive's zero changes.")  # fmt: skip
@click.option("--failures", is_flag=True, help="Show only what is not a pass.")
@click.option("--json", "json_out", type=JSON_FILE, help="Write the findings here; - is stdout.")
def command(
    node: int, machine: Path | None, bus: tuple[str, str] | None, simulate: bool, seed: int,
    power: bool, homing: bool, failures: bool, json_out: Path | None,
) -> None:  # fmt: skip
    """Check NODE against CiA 301 and CiA 402, any drive, without an EDS.

    The axis comes under force where it stands and gets its actual position as set-point; keep
    clear all the same. Values that are changed are put back, the drive ends disabled. Refused
    while another host is on the bus. Exit code 0 when nothing failed, else 1.
    """
    from drivers.bench.conformance import Verdict, run
    from drivers.canopen import LISTENING
    from stagectl.errors import StagectlError

    bench = Bench(machine, bus, simulate, seed)
    with bench.onlooker() as network, interruptible():
        network.listen(LISTENING)  # a stage that runs is left alone
        findings = run(network, node, power=power, homing=homing)
        label = network.label
    if json_out is not None:
        write_json([_entry(f) for f in findings], json_out)
    if not quietly(json_out):
        from rich.console import Console

        shown = [f for f in findings if not failures or f.verdict is not Verdict.PASS]
        if shown:
            Console().print(_table(shown, node, label))
        counts = {v: sum(f.verdict is v for f in findings) for v in Verdict}
        click.echo(", ".join(f"{n} {v.value}" for v, n in counts.items()))
    failed = [f for f in findings if f.verdict is Verdict.FAIL]
    if failed:
        raise StagectlError(
            f"node {node}: {len(failed)} of {len(findings)} checks failed, the first one: "
            f"{failed[0].group}: {failed[0].name}: {failed[0].detail}"
        )


def _entry(finding: Finding) -> dict[str, Any]:
    return {
        "group": finding.group, "check": finding.name, "verdict": finding.verdict.value,
        "detail": finding.detail,
    }  # fmt: skip


def _table(findings: list[Finding], node: int, label: str) -> Any:
    from rich.table import Table

    from drivers.bench.conformance import Verdict

    colours = {Verdict.FAIL: "bold red", Verdict.DIFFERS: "yellow", Verdict.PASS: "green"}
    table = Table(title=f"CiA 301 and CiA 402: node {node} on {label}", title_justify="left")
    for column in ("group", "check", "verdict", "what the drive did"):
        table.add_column(column)
    group = ""
    for finding in findings:
        if group and finding.group != group:
            table.add_section()
        table.add_row(
            "" if finding.group == group else finding.group, finding.name,
            f"[{colours.get(finding.verdict, 'dim')}]{finding.verdict.value}[/]", finding.detail,
        )  # fmt: skip
        group = finding.group
    return table
