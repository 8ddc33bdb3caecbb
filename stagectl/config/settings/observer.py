"""From a machine file to the figures of the settling observer, effects included."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from estimation.noise import encoder_noise
from estimation.observer import (
    AxisFigures,
    BusUnits,
    Carriage,
    Design,
    MeasuredLoop,
    Mode,
    StageObserver,
    design_observer,
)
from estimation.response import AxisResponse, Clocking, Figures, Fitted, Resonance, fit
from stagectl.config.machine import Axis, Drive, Effect, Machine
from stagectl.config.settings.host_model import drive_loop
from stagectl.config.settings.package_settings import stage_settings
from stagedata import FrictionFigures

LIMIT = 0.5
"""Largest correction, over the rated force."""
LEAST_TIME = 1e-4
"""Shorter measured times count for none [s]."""
COARSER = 3.0
"""Steps of force offsets are noticed from so many of the units in which they are sent."""
COARSE = 0.02
"""Steps above this share of the Coulomb force are no use: sticking friction holds more than it."""
DOUBT = 3.0
"""Multiples of the machine file's tolerance by which the mass may be off."""


def observer_figures(
    axis: Axis, friction: FrictionFigures, period: float, response: AxisResponse | None = None
) -> AxisFigures | str:
    """What the observer of an axis has to know, or why there is none.

    Args:
        axis: of the host's machine file.
        friction: as the host believes it to be.
        period: Ts [s].
        response: of the axis, as measured; None to believe the machine file.
    """
    if axis.observer == "none":
        return "switched off in the machine file"
    drive = axis.drive
    loop = drive_loop(drive)
    if loop is None:
        return "the drive's loops are a cascade, of which the observer has no model"
    figures = AxisFigures(
        loop,
        Carriage(axis.plant.mass, friction.stiffness, friction.viscous),
        friction.coulomb,
        encoder_noise(axis.encoder.noise, axis.encoder.increment),
        period,
        LIMIT * drive.rated_force,
        min(DOUBT * axis.plant.tolerance, 0.5),
    )
    if response is not None:
        return _as_measured(figures, fit_response(axis, friction, period, response), response, axis)
    return _with_effects(figures, axis.effects)


def clocking(drive: Drive, period: float) -> Clocking:
    """The fixed figures of a drive."""
    return Clocking(period, drive.control_period, drive.current_bandwidth)


def believed_figures(axis: Axis, friction: FrictionFigures) -> Figures:
    """The figures of an axis by its machine file, as a fit of its response has them."""
    loop = drive_loop(axis.drive)
    if loop is None:
        raise ValueError("the drive's loops are a cascade")
    carriage = Carriage(axis.plant.mass, friction.stiffness, friction.viscous)
    own = _with_effects(AxisFigures(loop, carriage, 0.0, 0.0, 1.0, 0.0), axis.effects)
    ratio = own.drive.force_ratio
    carriage = own.carriage
    return Figures(
        mass=carriage.mass / ratio,
        kp=own.drive.kp,
        ki=own.drive.ki,
        kd=own.drive.kd,
        derivative_time=own.drive.derivative_time,
        dead_time=own.drive.delay,
        viscous=carriage.viscous / ratio,
        stiffness=carriage.stiffness / ratio,
        resonances=tuple(
            Resonance(mode.frequency, mode.damping, mode.mass_ratio / (1.0 - mode.mass_ratio))
            for mode in carriage.hung
        ),
    )


def fit_response(
    axis: Axis, friction: FrictionFigures, period: float, response: AxisResponse
) -> Fitted:
    """The figures that a measured response shows."""
    return fit(response, clocking(axis.drive, period), believed_figures(axis, friction))


def offset_step(axis: Axis, response: AxisResponse) -> float | None:
    """Steps in which force offsets act [N]; None where they are no coarser than they are sent.

    Rounding to steps adds a force of step / sqrt(12) rms, which shows on lines that nobody shakes.
    """
    states = (response.sliding,) if response.sticks else response
    step = math.sqrt(12.0) * min(state.distortion for state in states)
    return step if step > COARSER * axis.drive.force_unit else None


def _if_long(time: float) -> float:
    """A measured time [s]; 0 where it is within what the closed form gets wrong."""
    return time if time > LEAST_TIME else 0.0


def _as_measured(
    figures: AxisFigures, fitted: Fitted, response: AxisResponse, axis: Axis
) -> AxisFigures | str:
    """The figures of a measured axis, in units of its force offsets."""
    shown = fitted.figures
    if shown.sign < 0.0:
        return "force offsets act with the wrong sign"
    step = offset_step(axis, response)
    if step is not None and step > COARSE * figures.coulomb:
        return f"force offsets act in steps of about {step:.2g} N, too coarse to correct friction"
    clocked = clocking(axis.drive, figures.period)
    return replace(
        figures,
        drive=replace(
            figures.drive,
            kp=shown.kp,
            ki=shown.ki,
            kd=shown.kd,
            derivative_time=shown.derivative_time,
            delay=max(shown.dead_time, 0.0),
        ),
        carriage=Carriage(
            shown.mass,
            0.0 if response.sticks else max(shown.stiffness, 0.0),
            max(shown.viscous, 0.0),
        ),
        mass_doubt=min(DOUBT * fitted.sigma["mass"], 0.5),
        age=_if_long(shown.age + shown.smoothing),
        lead=_if_long(shown.dead_time + shown.lateness - figures.drive.delay),
        measured=MeasuredLoop(response, clocked),
    )


def _with_effects(figures: AxisFigures, effects: Iterable[Effect]) -> AxisFigures:
    """The figures with those effects that change the loop; forces from outside do not."""
    drive, carriage, coulomb = figures.drive, figures.carriage, figures.coulomb
    for name, p in effects:
        match name:
            case "payload_mass":
                carriage = replace(carriage, mass=carriage.mass + p["mass"])
            case "presliding_stiffness":
                carriage = replace(carriage, stiffness=carriage.stiffness * p["ratio"])
            case "viscous_damping":
                carriage = replace(carriage, viscous=carriage.viscous * p["ratio"])
            case "coulomb_level":
                coulomb *= p["ratio"]
            case "current_bandwidth":
                drive = replace(drive, current_bandwidth=p["bandwidth"])
            case "dead_time":
                drive = replace(drive, delay=drive.delay + p["delay"])
            case "force_constant":
                drive = replace(drive, force_ratio=drive.force_ratio * p["ratio"])
            case "force_ripple":  # where the motor is strongest
                drive = replace(drive, force_ratio=drive.force_ratio * (1.0 + abs(p["ratio"])))
            case "motor_gain_table":
                drive = replace(drive, force_ratio=drive.force_ratio * max(p["factor"]))
            case "resonance":
                carriage = replace(carriage, hung=(*carriage.hung, _mode(p)))
            case "base_motion":
                carriage = replace(carriage, base=_mode(p))
    return replace(figures, drive=drive, carriage=carriage, coulomb=coulomb)


def _mode(p: Mapping[str, float]) -> Mode:
    return Mode(p["mass_ratio"], p["frequency"], p["damping"])


def design_observers(
    machine: Machine,
    friction: Mapping[str, FrictionFigures] | None = None,
    responses: Mapping[str, AxisResponse | str] | None = None,
) -> dict[str, Design | str]:
    """The observer of every axis, or why it has none.

    Args:
        machine: the host's.
        friction: axis -> figures to start from; None: those of the machine file.
        responses: axis -> measured response, or why there is none; None: the machine file is
            believed.

    Raises:
        ConfigError: the machine file has unknown effects, or impossible ones.
    """
    if any(axis.effects for axis in machine.axes.values()):
        stage_settings(machine)  # checks them
    period = machine.bus.sync_period
    found: dict[str, Design | str] = {}
    for name, axis in machine.axes.items():
        own = axis.plant.friction.figures if friction is None else friction[name]
        response = None if responses is None or axis.observer == "trust" else responses[name]
        measured = None if isinstance(response, str) else response
        figures = observer_figures(axis, own, period, measured)
        if isinstance(figures, str):  # an unmeasured axis may not be able to have one at all
            found[name] = figures
        elif isinstance(response, str):
            found[name] = response
        else:
            designed = design_observer(figures)
            found[name] = designed if designed.gain else "no gain keeps the sensitivity's peak"
    return found


def compile_observer(machine: Machine) -> None:
    """Compile, or load from the cache, what the observers need, before anything moves.

    Args:
        machine: the host's.
    """
    make_observer(machine, dict.fromkeys(machine.axes, ""), [None] * len(machine.axes))


def make_observer(
    machine: Machine, designs: Mapping[str, Design | str], peak_forces: Sequence[float | None]
) -> StageObserver:
    """The observers of all axes in the machine's order.

    Args:
        machine: the host's.
        designs: of `design_observers`.
        peak_forces: where each drive clamps its output [N]; None for an axis without 0x60B2.
    """
    chosen = []
    units = []
    for (name, axis), peak in zip(machine.axes.items(), peak_forces, strict=True):
        found = designs[name]
        chosen.append(None if isinstance(found, str) or peak is None else found)
        drive = axis.drive
        units.append(BusUnits(drive.position_unit, drive.force_unit, peak or drive.peak_force))
    control_period = next(iter(machine.axes.values())).drive.control_period
    return StageObserver(chosen, units, machine.bus.sync_period, control_period)
