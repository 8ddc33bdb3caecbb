"""Effects in a machine file: what reaches the simulator, and what is refused."""

from __future__ import annotations

import pytest

from stagectl.config import load_machine, parse_machine, stage_settings


def with_effect(text: str) -> str:
    return load_machine().text.replace("node: 1", f"node: 1\n    effects: [{text}]", 1)


def test_effects_reach_the_simulator() -> None:
    text = with_effect("{effect: force_offset, force: 1}, {effect: dead_time, delay: 0.0002}")
    x, y = stage_settings(parse_machine(text, "m")).axes
    assert [(e.effect.name, e.parameters) for e in x.effects] == [
        ("force_offset", {"force": 1.0}),
        ("dead_time", {"delay": 0.0002}),
    ]
    assert y.effects == ()


@pytest.mark.parametrize(
    ("effects", "key_and_reason"),
    [
        (
            "[{effect: cogging, amplitude: [1, 2], pitch: 0.03, phase: 0}]",
            ".effects[1].amplitude: must be a number",
        ),
        (
            "[^{effect: residual_table, position: [0, 0.1], force: [1, 2, 3], coulomb: [1, 1], "
            "velocity: [0, 1], velocity_force: [0, 1]}]",
            ".effects[1]: force: must have 2 values like position, has 3",
        ),
        (
            "[{effect: residual_table, position: [0, 0.1], force: [1, 2], coulomb: 1, velocity: "
            "[0, 1], velocity_force: [0, 1]}]",
            "coulomb: must be a list of numbers",
        ),
        (
            "[{effect: residual_table, position: [0, a], force: [1, 2], coulomb: [1, 1], "
            "velocity: [0, 1], velocity_force: [0, 1]}]",
            "residual_table: position[1] must be a number (SI), is 'a'",
        ),
        (
            "[{effect: ^coging, amplitude: 1, pitch: 0.03, phase: 0}]",
            ".effects[1].effect: unknown effect 'coging'; did you mean 'cogging'?",
        ),
        (
            "[{effect: cogging, amplitude: 1, ^ptch: 0.03, phase: 0}]",
            ".effects[1].ptch: unknown key of cogging; did you mean 'pitch'?",
        ),
        (
            "[^{effect: cogging, amplitude: 1, pitch: 0.03}]",
            ".effects[1]: cogging: phase is missing (phase at position 0 [rad])",
        ),
        (
            "[{effect: cogging, amplitude: 1, pitch: ^0, phase: 0}]",
            ".effects[1].pitch: must be >= 0.001 m, is 0",
        ),
        (
            "[^{effect: payload_mass, mass: -9}]",
            ".effects[1]: mass: leaves no mass of the axis' 8 kg",
        ),
        (
            "^[{effect: payload_mass, mass: -5}, {effect: payload_mass, mass: -5}]",
            ".effects: effects leave a mass of -2 kg",
        ),
        (
            "[{effect: friction_spot, amplitude: 0.1, center: 0, other: ^1.0e+300, width: 0.01}]",
            ".effects[1].other: must be within +-1e+15 m, is 1e+300",
        ),
    ],
)
def test_refused_effects_are_reported_with_their_place(
    check_refused, effects: str, key_and_reason: str
) -> None:
    check_refused(f"node: 1\n    effects: {effects}", key_and_reason)
