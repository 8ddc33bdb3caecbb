"""Ranges of machine parameters."""

import pytest

from stagectl.config import load_machine, parse_machine

GOOD = load_machine().text


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("mass: 8.0", "mass: 5 g"),  # a piezo stage's carriage
        ("coulomb: 6.0", "coulomb: 1.0e-6"),  # an air bearing
        ("viscous: 20.0", "viscous: 0.0"),
        ("increment: 1.0e-9", "increment: 1.0e-12"),  # an interferometer
        ("increment: 1.0e-9", "increment: 50 um"),
        ("current_bandwidth: 1500.0", "current_bandwidth: 10 kHz"),
        ("control_period: 1.0e-4", "control_period: 6.25e-5"),
        ("node: 1", "node: 1\n    homing: {velocity: 100 um/s, index_velocity: 1 um/s}"),
        ("correlation_time: 0.5", "correlation_time: 1.0e+6"),
    ],
)
def test_values_of_unusual_stages_are_accepted(old, new):
    parse_machine(GOOD.replace(old, new), "m")


def test_a_gantry_with_the_motor_it_needs_is_accepted():
    text = GOOD.replace("mass: 8.0", "mass: 2.0e+4")
    text = text.replace("rated_force: 40.0", "rated_force: 20 kN")
    parse_machine(text.replace("peak_force: 120.0", "peak_force: 60 kN"), "m")


@pytest.mark.parametrize(
    ("new", "key_and_reason"),
    [
        ("mass: ^1.0e+300", ".plant.mass: must be at most 1e+09 kg, is 1e+300"),
        ("current_bandwidth: ^1.0e-300", ".drive.current_bandwidth: must be at least 0.001 Hz"),
        ("repeatability: {coulomb: ^7.0, correlation_time: 0.5}", ".plant.friction.repeatability."),
        (
            "homing: {index_velocity: ^1.0e+300}",
            ".homing.index_velocity: must be at most 1e+06 m/s",
        ),
        ("enable_timeout: ^3600", ".drive.enable_timeout: must be at most 600 s, is 3600"),
        (
            "mass: ^80000.0",
            ".plant.mass: 80000 kg at 1 m/s need 333 m to stop, the travel is 0.3 m;",
        ),
        (
            "coulomb: ^90.0",
            ".plant.friction.coulomb: breakaway takes 126 N; the drive has 120 N at",
        ),
        ("viscous: ^200.0", ".plant.friction.viscous: at limits.velocity, 1 m/s, it is 200 N; the"),
        ("stiffness: ^6.0", ".plant.friction.stiffness: presliding over 1 m (coulomb / stiffness)"),
        (
            "following_error: ^0.5",
            ".limits.following_error: 0.5 m is never exceeded within the",
        ),
        (
            "following_error: 0.001, position_window: ^0.01",
            ".limits.position_window: 0.01 m must be below limits.following_error, 0.001 m",
        ),
        (
            "increment: ^0.01",
            ".encoder.increment: 0.01 m must be below limits.following_error",
        ),
        ("noise: ^1.0", ".encoder.noise: 1 m must be below limits.following_error, 0.001 m"),
    ],
)
def test_implausible_values_are_one_line_at_their_place(check_refused, new, key_and_reason):
    check_refused(new, key_and_reason)
