"""`stagectl check NODE --learn`: a drive profile of a live drive, with --move by moves as well."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import click

from stagectl.cli.bus_access import Bench
from stagectl.cli.signals import interruptible
from stagectl.errors import StagectlError, drivers_failures

if TYPE_CHECKING:
    from drivers.settings import AxisSettings
    from stagectl.measurement.learned import Facts

FOLDER = "drives"
"""Beside the machine file, where runs look for profiles by identity."""


def learn_profile(bench: Bench, node: int, move: bool, yes: bool, out: Path | None) -> None:
    """Write a profile of the drive with a node id.

    Args:
        bench: machine and bus.
        node: its id.
        move: home it and move it as well.
        yes: without asking.
        out: of the profile; None: in `FOLDER`, named by the identity.

    Raises:
        click.BadParameter: it is to move, and the machine file has no such axis.
        StagectlError: the drive did not take back what was tried.
    """
    from stagectl.config.profiles import family_of, render_profile
    from stagectl.store import write_atomically

    chosen = bench.axis_at(node) if move else None
    facts, refused = _read(bench, node)
    if chosen is not None:
        facts += _moved(bench, chosen, yes)
    family = family_of(facts)
    today = datetime.now(UTC).date()
    on = "a virtual drive" if bench.simulated else f"node {node} of {bench.machine.name}"
    text = render_profile(family, f"learned of {on}", facts, f"on {on}, {today}")
    where = out or Path(bench.machine.source).parent / FOLDER / f"{family}.yaml"
    where.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(where, text, "drive profile")
    click.echo(text, nl=False)
    click.echo(f"profile written to {where}", err=True)
    if refused:
        raise StagectlError(f"node {node} did not take back: {'; '.join(refused)}")


def _read(bench: Bench, node: int) -> tuple[Facts, list[str]]:
    from drivers.canopen import LISTENING
    from drivers.commissioning.learn import learn

    with bench.observer() as network, interruptible():
        network.listen(LISTENING)  # refuses a bus on which a host is active
        found, refused = learn(network, node)
    return [(fact.key, fact.value, fact.source) for fact in found], refused


def _moved(bench: Bench, chosen: AxisSettings, yes: bool) -> Facts:
    """What a short move and the measurement of `observer --measure` show."""
    from drivers.stage import Stage
    from stagectl.measurement import (
        check_scale,
        facts_of_response,
        facts_of_scale,
        measure_stage,
    )

    name, machine = chosen.name, bench.machine
    alone = machine.model_copy(update={"axes": {name: machine.axes[name]}})

    def agreed(lines: list[str]) -> bool:
        if yes or bench.simulated:
            return True
        for line in lines:
            click.echo(f"  {line}", err=True)
        return click.confirm("Go ahead?", err=True)

    if not agreed([f"axis {name} will be homed and moved by 0.1 mm and back three times"]):
        raise click.Abort
    with (
        drivers_failures(),
        bench.on_bus() as settings,
        Stage.open(settings, (chosen,)) as stage,
        interruptible() as stopped,
    ):
        stage.boot()
        stage.home()
        axis = stage.axes[0]
        facts = facts_of_scale(check_scale(stage, axis, machine))
        if axis.streams and axis.accepts_force_offset:
            now = datetime.now(UTC).astimezone()
            measured = measure_stage(stage, alone, now, agreed, stopped)
            response = measured.axes[name].response
            more, open_ = facts_of_response(machine.axes[name], settings.sync_period, response)
            facts += more
        else:
            open_ = "without csp or force offset there is no response to measure"
        stage.disable()
    if open_:
        click.echo(f"axis {name}: {open_}", err=True)
    return facts
