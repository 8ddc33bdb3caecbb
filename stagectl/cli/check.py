"""`stagectl check`: conformance of a drive to CiA 301 and CiA 402."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from stagectl.cli.bus_access import Bench
from stagectl.cli.file_kinds import PROFILE
from stagectl.cli.files import Output
from stagectl.cli.options import JSON_OUT, option, takes
from stagectl.cli.signals import interruptible
from stagectl.cli.terminal import make_table, show_result
from stagectl.errors import StagectlError

if TYPE_CHECKING:
    from rich.table import Table

    from drivers.commissioning.conformance import Finding
    from drivers.settings import AxisSettings
    from stagectl.measurement import Compared


@dataclass(frozen=True)
class _Move:
    """Of the check by a move, and of what is learned."""

    move: bool = option(
        "Instead, move the axis by 0.1 mm and back, after a question, and compare scale and sign.",
        default=False,
    )
    yes: bool = option("Move without asking.", default=False)
    learn: bool = option(
        "Instead, write a drive profile of what the drive says and takes; what is tried is "
        "restored. With --move also of what moves show: it is homed, shaken and slides.",
        default=False,
    )
    out: Path | None = option(
        "File of the profile.  [default: drives/IDENTITY.yaml beside the machine file]",
        Output(PROFILE),
    )


@click.command
@click.argument("node", type=click.IntRange(1, 126))
@takes(Bench)
@takes(_Move)
@click.option("--power/--no-power", default=True,
              help="Include checks that enable the drive.")  # fmt: skip
@click.option("--homing", is_flag=True,
              help="Include homing at the present position: changes the drive's zero.")  # fmt: skip
@click.option("--failures", is_flag=True, help="List only checks that did not pass.")
@JSON_OUT
def command(
    bench: Bench, how: _Move, node: int, power: bool, homing: bool, failures: bool,
    json_out: Path | None,
) -> None:  # fmt: skip
    """Test the drive with node id NODE, of any make, against CiA 301 and CiA 402; needs no EDS.

    The axis is enabled in place, with its actual position as the setpoint; keep clear of it all
    the same. Objects that are written get their old values back, and the drive ends disabled.
    Refused while another host is on the bus. Exit code 0 if no check failed, else 1.

    With --move, the axis of the machine file with this node id moves by 0.1 mm: position, velocity,
    force and force offset are compared with what was asked, and runs no longer list the axis as
    unchecked. A stage server lends its bus, and boots all drives again afterwards.
    """
    if how.yes and not how.move:
        raise click.UsageError("--yes needs --move")
    if how.out is not None and not how.learn:
        raise click.UsageError("--out needs --learn")
    if how.learn:
        from stagectl.cli.check_learn import learn_profile

        learn_profile(bench, node, how.move, how.yes, how.out)
        return
    if how.move:
        _check_by_move(bench, node, how.yes, json_out)
        return
    from drivers.commissioning.conformance import Verdict

    findings, label = _check(bench, node, power, homing)
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


def _check(bench: Bench, node: int, power: bool, homing: bool) -> tuple[list[Finding], str]:
    """What was found, and on which bus."""
    from drivers.canopen import LISTENING
    from drivers.commissioning.conformance import Finding, Verdict, run

    client = bench.served()
    if client is not None:
        from stagectl.cli.served import do
        from stagectl.protocol.requests import Check

        with client:
            job = do(client, Check(node=node, power=power, homing=homing))
            found = (job.result or {})["found"]
            return [
                Finding(**{**each, "verdict": Verdict(each["verdict"])}) for each in found
            ], client.info.bus
    with bench.observer() as network, interruptible():
        network.listen(LISTENING)  # refuses a bus on which a host is active
        return run(network, node, power=power, homing=homing), network.label


def _check_by_move(bench: Bench, node: int, yes: bool, json_out: Path | None) -> None:
    """Compare scale and sign; keep beside the machine file of a real stage that they agree."""
    from stagectl.measurement import note_checked

    chosen = bench.axis_at(node)
    if not (yes or bench.simulated):
        click.confirm(
            f"Axis {chosen.name} will move by 0.1 mm and back three times, at up to 0.5 mm/s if "
            "its units are right, and is pushed by a third of its friction. Go ahead?",
            abort=True, err=True,
        )  # fmt: skip
    compared, simulated = _compare(bench, chosen)
    show_result([asdict(c) for c in compared], json_out, _comparison(compared, chosen.name))
    wrong = [c.what for c in compared if c.agrees is False]
    if wrong:
        raise StagectlError(
            f"axis {chosen.name}: {'; '.join(wrong)}: not what was asked for; correct the units in "
            "the machine file or the drive's set-up before anything else moves it"
        )
    if not simulated:
        kept = note_checked(bench.machine, chosen.name, datetime.now(UTC))
        click.echo("no file to note it beside" if kept is None else f"noted in {kept}", err=True)


def _compare(bench: Bench, axis: AxisSettings) -> tuple[list[Compared], bool]:
    """What the move shows, and whether the drive is a virtual one."""
    from drivers.stage import Stage
    from stagectl.measurement import Compared, check_scale

    client = bench.served()
    if client is not None:
        from stagectl.cli.served import do
        from stagectl.protocol.requests import Check

        with client:
            job = do(client, Check(node=axis.node, move=True))
            found = (job.result or {})["found"]
            return [Compared(**each) for each in found], client.info.simulated
    with bench.on_bus() as settings, Stage.open(settings, (axis,)) as stage, interruptible():
        stage.boot()
        for notice in (*stage.limitations, *stage.notices):
            click.echo(notice, err=True)
        compared = check_scale(stage, stage.axes[0], bench.machine)
        stage.disable()
    return compared, bench.simulated


def _comparison(compared: list[Compared], axis: str) -> Table:
    def number(value: float | None) -> str:
        return "" if value is None else f"{value:.4g}"

    verdicts = {True: "agrees", False: "WRONG", None: "not compared"}
    rows = [
        (c.what, number(c.asked), number(c.found), verdicts[c.agrees], c.remark) for c in compared
    ]
    return make_table(
        f"axis {axis}: a move of 0.1 mm", ("", "asked", "found", "verdict", "remark"), rows
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
