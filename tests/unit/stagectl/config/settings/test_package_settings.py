"""Every figure of the machine file reaches the settings it belongs to."""

from dataclasses import astuple

import pytest

from drivers import objects as od
from drivers.drive import unit
from stagectl.config import driver_settings, load_machine, parse_machine, stage_settings
from stagectl.errors import ConfigError
from tests.simple_law import simple_law_text


def test_stage_settings_hold_the_figures_exactly():
    machine = load_machine()
    stage = stage_settings(machine)
    assert (stage.sync_period, stage.control_period, stage.ticks) == (1e-3, 1e-4, 10)
    for settings, axis in zip(stage.axes, machine.axes.values(), strict=True):
        friction, given = settings.friction, axis.plant.friction
        assert friction.law == given.model
        for name in (
            "elements", "coulomb", "static_ratio", "stribeck_velocity", "stribeck_shape",
            "stiffness", "attraction", "viscous",
        ):  # fmt: skip
            assert getattr(friction, name) == getattr(given, name)
        assert settings.wander == given.repeatability.coulomb
        assert settings.correlation_time == given.repeatability.correlation_time
        for name in ("kp", "ki", "kd", "derivative_time"):
            assert getattr(settings.control, name) == getattr(axis.drive.pid, name)
        for name in ("current_bandwidth", "rated_force", "peak_force"):
            assert getattr(settings.control, name) == getattr(axis.drive, name)
        for name in ("velocity", "acceleration", "jerk", "following_error"):
            assert getattr(settings, name) == getattr(axis.limits, name)
        assert (settings.node, settings.mass) == (axis.node, axis.plant.mass)
        assert (settings.increment, settings.noise) == (axis.encoder.increment, axis.encoder.noise)
        assert settings.travel == axis.travel


def test_quirks_and_the_encoders_place_reach_the_simulated_drive_alone():
    odd = "{offset_delay: 3, offset_sign: -1, offset_step: 0.01, position_delay: 1}"
    text = load_machine().text.replace(
        "rated_force: 40.0", f"rated_force: 40.0\n      quirks: {odd}"
    )
    text = text.replace("noise: 1.0e-9}", "noise: 1.0e-9, on_load: true}", 1)
    machine = parse_machine(text, "m.yaml")
    x, y = stage_settings(machine).axes
    assert astuple(x.quirks) == (3, -1, 0.01, 1, 0.0)
    assert x.encoder_on_load
    assert y.quirks is None
    assert driver_settings(machine) == driver_settings(load_machine())


def test_driver_settings_hold_bus_limits_and_homing():
    text = load_machine().text.replace(
        "node: 1", "node: 1\n    homing: {method: 33, velocity: 5 mm/s}", 1
    )
    slow = "boot_timeout: 12 s\n      enable_timeout: 8000 ms\n      revision: 3"
    text = text.replace("rated_force: 40.0", f"rated_force: 40.0\n      {slow}")
    bus, (x, y) = driver_settings(parse_machine(text, "m.yaml"))
    assert (bus.interface, bus.channel, bus.bitrate, bus.sync_period) == (
        "virtual", "stage", 1_000_000, 1e-3,
    )  # fmt: skip
    assert (x.name, x.node, x.rated_force, x.peak_force) == ("x", 1, 40.0, 120.0)
    assert (y.travel, y.velocity, y.jerk, y.following_error) == ((-0.15, 0.15), 1.0, 2000.0, 1e-3)
    assert (x.homing_method, x.homing_velocity) == (33, (0.005, 0.002))
    assert (y.homing_method, y.homing_velocity) == (34, (0.01, 0.002))
    assert (x.boot_timeout, x.enable_timeout, x.revision) == (12.0, 8.0, 3)
    assert (y.boot_timeout, y.enable_timeout, y.revision) == (2.0, 2.0, None)
    assert x.eds.name == "stagectl-linear-drive.eds"


def test_units_that_are_not_written_are_a_default_and_no_knowledge():
    units = "position_unit: 5 nm\n      acceleration_unit: 1e-3"
    text = load_machine().text.replace("rated_force: 40", f"{units}\n      rated_force: 40", 1)
    machine = parse_machine(text, "m.yaml")
    _, (x, y) = driver_settings(machine)
    assert (x.velocity_unit, x.acceleration_unit) == (0.0, 1e-3)
    assert (y.velocity_unit, y.acceleration_unit) == (0.0, 0.0)
    assert (x.velocity_unit_si, y.acceleration_unit_si) == (5e-9, 1e-6)
    for axis, virtual in zip((x, y), stage_settings(machine).axes, strict=True):
        assert virtual.unit == axis.increment
        assert virtual.velocity_unit == axis.velocity_unit_si
        assert virtual.acceleration_unit == axis.acceleration_unit_si


def test_the_files_units_are_those_in_which_the_drivers_write():
    """Observer, journal and checks of the file count in them too."""
    text = load_machine().text
    for rated in ("rated_force: 40.0", "rated_force: 60.0"):
        units = "position_unit: 5 nm\n      velocity_unit: 3 um/s\n      acceleration_unit: 7e-4"
        text = text.replace(rated, f"{units}\n      {rated}")
    for machine in (load_machine(), parse_machine(text, "m.yaml")):
        for axis, settings in zip(machine.axes.values(), driver_settings(machine)[1], strict=True):
            assert axis.drive.position_unit == unit(settings, od.TARGET_POSITION)
            assert axis.drive.velocity_count == unit(settings, od.PROFILE_VELOCITY)
            assert axis.drive.acceleration_count == unit(settings, od.PROFILE_ACCELERATION)
            assert axis.drive.force_unit == unit(settings, od.FORCE_OFFSET)


def test_a_named_eds_is_relative_to_the_machine_file(tmp_path):
    text = load_machine().text.replace("node: 1", "node: 1\n    eds: mine.eds", 1)
    path = tmp_path / "m.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=r"m\.yaml:12:10: axes\.x\.eds: no such file"):
        driver_settings(load_machine(path))
    (tmp_path / "mine.eds").touch()
    assert driver_settings(load_machine(path))[1][0].eds == tmp_path / "mine.eds"


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ("mass: 8.0", "mass: 1.0e-6", "friction of 20 N s/m on 1e-06 kg"),
        ("stiffness: 6.0e5", "stiffness: 1.0e+15", "springs of 1e+15 N/m on 8 kg"),
    ],
)
def test_a_plant_too_stiff_for_any_steps_is_refused(old, new, problem):
    machine = parse_machine(load_machine().text.replace(old, new), "m")
    driver_settings(machine)  # a real stage may have it
    with pytest.raises(ConfigError) as caught:
        stage_settings(machine)
    expected = f"axes.x.plant: {problem} cannot be simulated in 1000 steps per control_period"
    assert caught.value.problems[0].partition(": ")[2] == expected


def test_an_effect_on_presliding_needs_a_law_that_has_it():
    effects = "    effects: [{effect: presliding_stiffness, ratio: 2.0}]\n  y:\n"
    with pytest.raises(ConfigError) as caught:
        stage_settings(parse_machine(simple_law_text().replace("  y:\n", effects, 1), "m.yaml"))
    (line,) = caught.value.problems
    place, _, reason = line.partition(": presliding_stiffness: ")
    assert place.endswith("axes.x.effects[1]")
    assert reason == "the friction law coulomb has no presliding stiffness"
