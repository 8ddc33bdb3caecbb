"""Ranges of machine parameters."""

from __future__ import annotations

import pytest

from stagectl.config import load_machine, parse_machine

GOOD = load_machine().text


@pytest.mark.parametrize(
    ("old", "new", "key_and_reason"),
    [
        (
            "mass: 8.0",
            "mass: ^1.0e+300",
            "axes.x.plant.mass: must be at most 1e+09 kg, is 1e+300",
        ),
        (
            "current_bandwidth: 1500.0",
            "current_bandwidth: ^1.0e-300",
            "axes.x.drive.current_bandwidth: must be at least 0.001 Hz, is 1e-300",
        ),
        (
            "repeatability: {coulomb: 0.01",
            "repeatability: {coulomb: ^7.0",
            "axes.x.plant.friction.repeatability.coulomb: must be at most 1, is 7",
        ),
        (
            "node: 1",
            "node: 1\n    homing: {index_velocity: ^1.0e+300}",
            "axes.x.homing.index_velocity: must be at most 1e+06 m/s, is 1e+300",
        ),
        (
            "rated_force: 40.0",
            "rated_force: 40.0\n      enable_timeout: ^3600",
            "axes.x.drive.enable_timeout: must be at most 600 s, is 3600",
        ),
    ],
)
def test_implausible_values_are_one_line_at_their_place(
    check_refused, old: str, new: str, key_and_reason: str
) -> None:
    check_refused(old, new, key_and_reason)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("mass: 8.0", "mass: 5 g"),  # a piezo stage's carriage
        ("mass: 8.0", "mass: 2.0e+4"),  # a gantry
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
def test_values_of_unusual_stages_are_accepted(old: str, new: str) -> None:
    parse_machine(GOOD.replace(old, new), "m")
