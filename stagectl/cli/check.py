"""`stagectl check`: conformance of a drive to CiA 301 and CiA 402."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from stagectl.cli.bus_access import Bench
from stagectl.cli.console import make_table, show_result
from stagectl.cli.options import JSON_OUT, takes
from stagectl.cli.signals import interruptible
from stagectl.errors import StagectlError

if TYPE_CHECKING:
    from rich.table import Table

    from drivers.commissioning.conformance import Finding


@click.command
@click.argument("node", type=click.IntRange(1, 126))
@takes(Bench)
@click.option("--power/--no-power", default=True,
              help="Include checks that enable the drive.")  # fmt: skip
@click.option("--homing", is_flag=True,
              help="Include homing at the present position: changes the drive's zero.")  # fmt: skip
@click.option("--failures", is_flag=True, help="List only checks that did not pass.")
@JSON_OUT
def command(
    bench: Bench, node: int, power: bool, homing: bool, failures: bool, json_out: Path | None
) -> None:
    """Test the drive with node id NODE, of any make, against CiA 301 and CiA 402; needs no EDS.

    The axis is enabled in place, with its actual position as the setpoint; keep clear of it all
    the same. Objects that are written get their old values back, and the drive ends disabled.
    Refused while another host is on the bus. Exit code 0 if no check failed, else 1.
    """
    from drivers.canopen import LISTENING
    from drivers.commissioning.conformance import Verdict, run

    with bench.observer() as network, interruptible():
        network.listen(LISTENING)  # refuses a bus on which a host is active
        findings = run(network, node, power=power, homing=homing)
        label = network.label
    listed = [f for f in findings if not failures or f.verdict is not Verdict.PASS]
    table = [_table(listed, node, label)] if listed else []
    counts = ", ".join(f"{sum(f.verdict is v for f in findings)} {v.value}" for v in Verdict)
    show_result([asdict(f) for f in findings], json_out, *table, counts)
    failed = [f for f in findings if f.verdict is Verdict.FAIL]
    if failed:
        raise StagectlError(
            f"node {node}: {len(failed)} of {len(findings)} checks failed, first: "
            f"{failed[0].group}: {failed[0].check}: {failed[0].detail}"
        )


def _table(findings: list[Finding], node: int, label: str) -> Table:
    from rich.text import Text

    from drivers.commissioning.conformance import Verdict

    colours = {Verdict.FAIL: "bold red", Verdict.DIFFERS: "yellow", Verdict.PASS: "green"}
    rows: list[Any] = []
    group = ""
    for finding in findings:
        named = "" if finding.group == group else finding.group
        if group and named:
            rows.append(None)
        verdict = Text(finding.verdict.value, colours.get(finding.verdict, "dim"))
        rows.append((named, finding.check, verdict, finding.detail))
        group = finding.group
    title = f"CiA 301 and CiA 402: node {node} on {label}"
    return make_table(title, ("group", "check", "verdict", "what the drive did"), rows)
