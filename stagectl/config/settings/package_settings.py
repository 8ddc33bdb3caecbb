"""From a machine file to the settings of simulator and drivers.

Those packages know neither YAML nor the machine model; each has frozen settings of its own.
"""

from __future__ import annotations

from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

from stagectl.config.machine import Axis, Drive, Machine
from stagectl.config.profiles import fill, profile_of
from stagectl.config.settings.habits import MODES, habits_of
from stagectl.errors import ConfigError

if TYPE_CHECKING:
    import drivers.settings
    import hil_sim.settings
    from stagectl.config.profiles import Profile


_DEMANDED = {"velocity", "acceleration", "jerk", "following_error"}
"""Limits that the simulator has too."""


def stage_settings(machine: Machine) -> hil_sim.settings.StageSettings:
    """The simulator's settings: exactly the parameters in the file, nothing drawn from `tolerance`.

    A drive whose profile the file names has that family's habits.

    Raises:
        ConfigError: unknown effects or impossible values, a plant too stiff for its steps, or a
            profile of a drive that cannot be used.
    """
    from hil_sim import settings
    from stagectl.config.settings.effects import add_effects

    axes = []
    for name, axis in machine.axes.items():
        profile = _played(machine, name)
        friction, drive = axis.plant.friction, fill(axis, profile).drive
        axes.append(
            settings.AxisSettings(
                name=name,
                node=axis.node,
                mass=axis.plant.mass,
                friction=friction.figures,
                control=_control(drive),
                increment=axis.encoder.increment,
                noise=axis.encoder.noise,
                travel=axis.travel,
                rotary=axis.rotary,
                **axis.limits.model_dump(include=_DEMANDED),
                wander=friction.repeatability.coulomb,
                correlation_time=friction.repeatability.correlation_time,
                unit=drive.position_unit,
                quirks=drive.quirks,
                habits=habits_of(profile, drive),
                encoder_on_load=axis.encoder.on_load,
                velocity_unit=drive.velocity_count,
                acceleration_unit=drive.acceleration_count,
            )
        )
    effective = add_effects(machine, axes)
    return settings.StageSettings(sync_period=machine.bus.sync_period, axes=tuple(effective))


def _played(machine: Machine, name: str) -> Profile | None:
    """The profile that an axis' virtual drive plays; None: none.

    The machine file in a recording may name a file that is not here, and has no drives to simulate.
    """
    given = machine.axes[name].drive.profile or ""
    if given.endswith(".yaml") and not (Path(machine.source).parent / given).is_file():
        return None
    return profile_of(machine, name, None)


def _control(drive: Drive) -> hil_sim.settings.ControlSettings:
    from hil_sim import settings

    loops = None
    if drive.cascade is not None:
        cascade = drive.cascade
        loops = settings.CascadeSettings(**cascade.model_dump(exclude={"derivative_time"}))
        gains = {
            "kp": cascade.velocity_gain * cascade.position_gain,
            "ki": cascade.velocity_integral * cascade.position_gain,
            "kd": cascade.velocity_gain,
            "derivative_time": cascade.derivative_time,
        }
    else:
        assert drive.pid is not None  # noqa: S101 - machine_checks requires one of them
        gains = drive.pid.model_dump()
    return settings.ControlSettings(
        **gains,
        current_bandwidth=drive.current_bandwidth,
        rated_force=drive.rated_force,
        peak_force=drive.peak_force,
        period=drive.control_period,
        cascade=loops,
    )


def driver_settings(
    machine: Machine, named: tuple[str, str] | None = None
) -> tuple[drivers.settings.BusSettings, tuple[drivers.settings.AxisSettings, ...]]:
    """The drivers' settings: bus, and per axis node, EDS, scaling, limits and homing.

    Args:
        machine: whose they are.
        named: (interface, channel) in place of the machine's.

    Raises:
        ConfigError: an axis' EDS file does not exist, or the profile of its drive cannot be used.
    """
    from drivers import settings

    given = dict(machine.bus)
    if named is not None:
        given["interface"], given["channel"] = named
    bus = settings.BusSettings(sync_source=given.pop("sync"), **given)
    axes = tuple(_driver_axis(machine, name, axis) for name, axis in machine.axes.items())
    return bus, axes


def _driver_axis(machine: Machine, name: str, axis: Axis) -> drivers.settings.AxisSettings:
    """The drivers' settings of an axis, with what the profile of its drive knows."""
    from drivers import settings

    eds = eds_path(machine, name, axis)
    filled = fill(axis, profile_of(machine, name, None if axis.eds is None else eds))
    drive = filled.drive
    return settings.AxisSettings(
        name=name,
        node=axis.node,
        eds=eds,
        rated_force=drive.rated_force,
        peak_force=drive.peak_force,
        travel=axis.travel,
        **dict(axis.limits),
        increment=drive.position_unit,
        encoder=axis.encoder.increment,
        velocity_unit=drive.velocity_unit or 0.0,
        acceleration_unit=drive.acceleration_unit or 0.0,
        lead=drive.lead or 0.0,
        rated_force_unit=drive.rated_force_unit,
        modes=tuple(MODES[mode] for mode in drive.modes or ()),
        csp_mode=filled.csp_mode,
        confirms_homing=filled.homing_attained,
        without_offset=filled.without_offset,
        note=filled.note,
        warnings=drive.warnings,
        heartbeat=drive.heartbeat,
        homing_method=axis.homing.method,
        homing_velocity=(axis.homing.velocity, axis.homing.index_velocity),
        options=drive.options,
        unwatched_host=drive.unwatched_host == "accept",
        boot_timeout=drive.boot_timeout,
        enable_timeout=drive.enable_timeout,
        revision=drive.revision,
        rotary=axis.rotary,
    )


def eds_path(machine: Machine, name: str, axis: Axis) -> Path:
    """The axis' EDS file: the one named in the machine file, else the virtual drive's.

    Raises:
        ConfigError: the file does not exist.
    """
    if axis.eds is None:
        return Path(str(resources.files("hil_sim") / "eds" / "stagectl-linear-drive.eds"))
    path = Path(machine.source).parent / axis.eds
    if not path.is_file():
        raise ConfigError(machine.document.problem(("axes", name, "eds"), f"no such file: {path}"))
    return path
