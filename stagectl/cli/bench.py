"""`stagectl enable`, `home` and `jog`: move the stage by hand, with all checks of a run."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import click

from stagectl.cli.bus_access import Bench
from stagectl.cli.options import NumberRange, Quantity, takes
from stagectl.cli.signals import interruptible

if TYPE_CHECKING:
    from drivers.settings import AxisSettings
    from drivers.stage import Stage
    from stagectl.client import Client
    from stagectl.protocol.requests import Command

_JOG_VELOCITY = 10e-3
_JOG_ACCELERATION = 1.0
"""Default profile of a jog, reduced to the axis limits [m/s, m/s^2]."""
_SLICE = 0.05  # between looks at Ctrl-C [s]
_NEGATIVE = {"ignore_unknown_options": True}  # -2mm is a distance, not an option


@click.command
@takes(Bench)
@click.option("--hold", "duration", type=NumberRange(0, 3600),
              help="Disable again after this time [s].  [default: at Ctrl-C]")  # fmt: skip
@click.option("--reset", is_flag=True, help="Acknowledge drive faults first.")
def enable(bench: Bench, duration: float | None, reset: bool) -> None:
    """Enable all axes and hold them where they are, then disable them.

    The position loops stay closed for as long as this command runs. If it is killed, the drives
    miss its heartbeat and quick-stop by themselves.
    """
    if bench.simulated and duration is None:
        duration = 1.0
    client = bench.served()
    if client is not None:
        _enable_served(client, duration, reset)
        return
    with bench.stage() as stage, interruptible() as stopped:
        _boot(stage, reset)
        stage.enable()
        _report_positions(stage, "enabled, holding")
        end = None if duration is None else stage.clock.now_ns() + round(duration * 1e9)
        while not stopped() and (end is None or stage.clock.now_ns() < end):
            left = _SLICE if end is None else min(_SLICE, (end - stage.clock.now_ns()) * 1e-9)
            stage.hold(left)
        _report_positions(stage, "held")
        stage.disable()
    click.echo("disabled")


@click.command
@takes(Bench)
@click.option("--reset", is_flag=True, help="Acknowledge drive faults first.")
def home(bench: Bench, reset: bool) -> None:
    """Home all axes by the methods in the machine file, then disable them.

    The drives keep their zero until they are switched off. A stage server holds them afterwards.
    """
    client = bench.served()
    if client is not None:
        from stagectl.protocol.requests import Home

        _on_server(client, "homed", Home(force=True, reset=reset))
        return
    with bench.stage() as stage, interruptible():
        _boot(stage, reset)
        stage.home(force=True)
        _report_positions(stage, "homed")
        stage.disable()


@click.command(context_settings=_NEGATIVE)
@click.argument("axis")
@click.argument("distance", type=Quantity("LENGTH"))
@takes(Bench)
@click.option(
    "--velocity", type=Quantity("VELOCITY"), help="Velocity of the move.  [default: 10 mm/s]"
)
@click.option("--here", is_flag=True, help="Do not home first; rely on the drive's present zero.")
@click.option("--reset", is_flag=True, help="Acknowledge drive faults first.")
def jog(
    bench: Bench, axis: str, distance: float, velocity: float | None, here: bool, reset: bool
) -> None:
    """Move AXIS by DISTANCE (in metres, or with a unit: 2mm, -50um) in profile position mode.

    \b
      stagectl jog x 2mm --simulate
      stagectl jog y -50um --velocity 1mm/s

    The stage is homed first, because the travel limits count from its zero, so the move starts
    there. After `stagectl home`, use --here to start where the axis is. Velocity and target are
    checked against the machine file before the axis moves.
    """  # noqa: D301  (\b keeps click from wrapping what follows)
    chosen = _axis(bench.axes, axis)
    speed, acceleration = _profile(chosen, velocity)
    _check_distance(chosen, distance, here)
    client = bench.served()
    if client is not None:
        _jog_served(client, axis, distance, speed, here, reset)
        return
    with bench.stage() as stage, interruptible():
        _boot(stage, reset)
        stage.check_move_to(axis, speed, acceleration)
        if not here:
            stage.home()
        stage.enable()
        column = [a.name for a in stage.axes].index(axis)
        start = stage.targets[column]
        stage.move_to(axis, start + distance, speed, acceleration)
        stage.hold(0.1)
        _report_positions(
            stage, f"{axis} moved by {(stage.positions[column] - start) * 1e3:.6f} mm"
        )
        stage.disable()


def _on_server(client: Client, what: str, *commands: Command) -> None:
    """Have a server do something, then say where the axes are."""
    from stagectl.cli.served import do

    with client:
        for command in commands:
            do(client, command)
        axes = client.state().axes
    at = ", ".join(f"{a.name} {(a.position or 0.0) * 1e3:.6f} mm" for a in axes)
    click.echo(f"{what}: {at}; the server holds the axes")


def _enable_served(client: Client, duration: float | None, reset: bool) -> None:
    from stagectl.cli.served import do
    from stagectl.protocol.requests import Disable, Enable

    with client:
        do(client, Enable(reset=reset))
        click.echo("enabled, held by the server")
        with interruptible() as stopped:
            end = None if duration is None else time.monotonic() + duration
            while not stopped() and (end is None or time.monotonic() < end):
                time.sleep(_SLICE)
        do(client, Disable())
    click.echo("disabled")


def _jog_served(
    client: Client, axis: str, distance: float, speed: float, here: bool, reset: bool
) -> None:
    from stagectl.protocol.requests import Enable, Home, Move

    first: Command = Enable(reset=reset) if here else Home(reset=reset)
    move = Move(axis=axis, distance=distance, velocity=speed)
    _on_server(client, f"{axis} moved by {distance * 1e3:.6f} mm", first, move)


def _boot(stage: Stage, reset: bool) -> None:
    """Boot the drives and report what they lack."""
    stage.boot()
    for notice in (*stage.limitations, *stage.notices):
        click.echo(notice, err=True)
    if reset:
        stage.reset_faults()


def _axis(axes: tuple[AxisSettings, ...], name: str) -> AxisSettings:
    for axis in axes:
        if axis.name == name:
            return axis
    raise click.BadParameter(
        f"no axis {name!r}; there are {', '.join(a.name for a in axes)}", param_hint="AXIS"
    )


def _profile(axis: AxisSettings, velocity: float | None) -> tuple[float, float]:
    speed = min(_JOG_VELOCITY, axis.velocity) if velocity is None else velocity
    if not 0 < speed <= axis.velocity:
        raise click.BadParameter(
            f"axis {axis.name}: must be in (0, {axis.velocity:g}] m/s, is {speed:g}",
            param_hint="--velocity",
        )
    return speed, min(_JOG_ACCELERATION, axis.acceleration)


def _check_distance(axis: AxisSettings, distance: float, here: bool) -> None:
    """Refuse a distance that cannot be within the travel, wherever the axis is."""
    low, high = axis.travel
    if here and abs(distance) > high - low:
        reason = f"{distance:g} m is more than its travel of {high - low:g} m"
    elif not here and not low <= distance <= high:
        reason = f"{distance:g} m from zero is outside its travel {low:g}..{high:g} m"
    else:
        return
    raise click.BadParameter(f"axis {axis.name}: {reason}", param_hint="DISTANCE")


def _report_positions(stage: Stage, what: str) -> None:
    at = ", ".join(
        f"{axis.name} {position * 1e3:.6f} mm"
        for axis, position in zip(stage.axes, stage.positions, strict=True)
    )
    click.echo(f"{what}: {at}")
