"""The machine of a machine file."""

from __future__ import annotations

import pickle

import pytest

from stagectl.config import load_machine, parse_machine
from stagectl.errors import ConfigError

GOOD = load_machine().text


def changed(old: str, new: str) -> str:
    """The packaged machine with the first `old` (that of axis x) replaced."""
    assert old in GOOD
    return GOOD.replace(old, new, 1)


def test_units_mean_the_same_as_si_figures() -> None:
    text = changed("stiffness: 6.0e5", "stiffness: 0.6 N/um").replace(
        "sync_period: 0.001", "sync_period: 1 ms"
    )
    assert parse_machine(text, "m").axes == load_machine().axes


def test_a_machine_survives_pickling() -> None:
    machine = load_machine()
    assert pickle.loads(pickle.dumps(machine)).text == machine.text  # noqa: S301 - our own
    assert pickle.loads(pickle.dumps(machine)) == machine  # noqa: S301 - our own


def machine_with(effect: str):
    text = load_machine().text.replace("node: 1", f"node: 1\n    effects: [{effect}]", 1)
    return parse_machine(text, "m")


def test_effects_are_kept_as_names_and_figures() -> None:
    machine = machine_with("{effect: cogging, amplitude: 1.2, phase: 0}")
    ((name, figures),) = machine.axes["x"].effects
    assert name == "cogging"
    assert figures == {"amplitude": 1.2, "phase": 0.0}


def test_a_list_becomes_a_tuple_of_numbers() -> None:
    ((_, figures),) = machine_with("{effect: residual_table, force: [1, -2.5]}").axes["x"].effects
    assert figures == {"force": (1.0, -2.5)}


@pytest.mark.parametrize(
    ("effect", "problem"),
    [
        ("cogging", "must be a mapping {effect: name, key: number}, is 'cogging'"),
        ("{amplitude: 1}", "needs the key effect with the effect's name"),
        ("{effect: ''}", "needs the key effect with the effect's name"),
        ("{effect: cogging, phase: yes}", "cogging: phase must be a number (SI), is 'yes'"),
        ("{effect: cogging, phase: true}", "cogging: phase must be a number (SI), is true"),
        ("{effect: t, force: [1, null]}", "t: force[1] must be a number (SI), is empty"),
    ],
)
def test_anything_else_is_refused_with_its_place(effect: str, problem: str) -> None:
    with pytest.raises(ConfigError) as refused:
        machine_with(effect)
    assert str(refused.value).startswith("m:12:")
    assert str(refused.value).endswith(f"axes.x.effects[1]: {problem}")
