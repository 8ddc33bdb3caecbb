"""Effects in a machine file: what reaches the simulator, and what is refused."""

import pytest

from stagectl.config import stage_settings
from tests.unit.stagectl.machines import with_effects


def test_effects_reach_the_simulator():
    machine = with_effects("effect: force_offset, force: 1", "effect: dead_time, delay: 0.0002")
    x, y = stage_settings(machine).axes
    assert [(e.effect.name, e.parameters) for e in x.effects] == [
        ("force_offset", {"force": 1.0}),
        ("dead_time", {"delay": 0.0002}),
    ]
    assert y.effects == ()


TABLE = "coulomb: [1, 1], velocity: [0, 1], velocity_force: [0, 1]"


@pytest.mark.parametrize(
    ("effects", "reason"),
    [
        (
            "{effect: cogging, amplitude: [1, 2], pitch: 0.03, phase: 0}",
            "[1].amplitude: must be",
        ),
        (
            f"^{{effect: residual_table, position: [0, 0.1], force: [1, 2, 3], {TABLE}}}",
            "[1]: force: must have 2 values like position, has 3",
        ),
        (
            f"{{effect: residual_table, position: 1, force: [1, 2], {TABLE}}}",
            "[1].position: must be a list of numbers",
        ),
        (
            "{effect: ^coging, pitch: 0.03}",
            "[1].effect: unknown effect 'coging'; did you mean",
        ),
        (
            "{effect: cogging, ^ptch: 0.03}",
            "[1].ptch: unknown key of cogging; did you mean 'pitch'?",
        ),
        (
            "^{effect: cogging, amplitude: 1, pitch: 0.03}",
            "[1]: cogging: phase is missing (",
        ),
        (
            "{effect: cogging, amplitude: 1, pitch: ^0, phase: 0}",
            "[1].pitch: must be >= 0.001 m, is 0",
        ),
        ("^{effect: payload_mass, mass: -9}", "[1]: mass: leaves no mass of the axis' 8 kg"),
        (
            "{effect: friction_spot, amplitude: 0.1, center: 0, other: ^1.0e+300, width: 0.01}",
            "[1].other: must be within +-1e+15 m, is 1e+300",
        ),
    ],
)
def test_refused_effects_are_reported_with_their_place(check_refused, effects, reason):
    check_refused(f"effects: [{effects}]", f".effects{reason}")


def test_effects_together_leave_a_mass(check_refused):
    light = "{effect: payload_mass, mass: -5}"
    check_refused(f"effects: ^[{light}, {light}]", ".effects: effects leave a mass of -2 kg")
