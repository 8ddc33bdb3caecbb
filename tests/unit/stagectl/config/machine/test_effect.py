"""Effects as they stand in a machine file."""

import pytest

from stagectl.config import load_machine, parse_machine
from stagectl.errors import ConfigError


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
