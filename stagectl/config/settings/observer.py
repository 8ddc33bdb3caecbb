"""From a machine file to the figures of the settling observer, effects included."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from estimation.noise import encoder_noise
from estimation.observer import (
    AxisFigures,
    BusUnits,
    Carriage,
    Design,
    Mode,
    StageObserver,
    design_observer,
)
from stagectl.config.machine import Axis, Effect, Machine
from stagectl.config.settings.host_model import drive_loop
from stagectl.config.settings.package_settings import stage_settings
from stagedata import FrictionFigures

LIMIT = 0.5
"""Largest correction, over the rated force."""
DOUBT = 3.0
"""Multiples of the machine file's tolerance by which the mass may be off."""


def observer_figures(axis: Axis, friction: FrictionFigures, period: float) -> AxisFigures | str:
    """What the observer of an axis has to know, or why there is none.

    Args:
        axis: of the host's machine file.
        friction: as the host believes it to be.
        period: Ts [s].
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
    return _with_effects(figures, axis.effects)


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
            case "resonance":
                carriage = replace(carriage, hung=(*carriage.hung, _mode(p)))
            case "base_motion":
                carriage = replace(carriage, base=_mode(p))
    return replace(figures, drive=drive, carriage=carriage, coulomb=coulomb)


def _mode(p: Mapping[str, float]) -> Mode:
    return Mode(p["mass_ratio"], p["frequency"], p["damping"])


def design_observers(
    machine: Machine, friction: Mapping[str, FrictionFigures] | None = None
) -> dict[str, Design | str]:
    """The observer of every axis, or why it has none.

    Args:
        machine: the host's.
        friction: axis -> figures to start from; None: those of the machine file.

    Raises:
        ConfigError: the machine file has unknown effects, or impossible ones.
    """
    if any(axis.effects for axis in machine.axes.values()):
        stage_settings(machine)  # checks them
    period = machine.bus.sync_period
    found: dict[str, Design | str] = {}
    for name, axis in machine.axes.items():
        own = axis.plant.friction.figures if friction is None else friction[name]
        figures = observer_figures(axis, own, period)
        if isinstance(figures, str):
            found[name] = figures
            continue
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
