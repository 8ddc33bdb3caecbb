"""The machine of a machine file."""

import pickle

import pytest

from stagectl.config import load_machine, parse_machine
from stagectl.errors import ConfigError
from tests.unit.stagectl.machines import with_effects

GOOD = load_machine().text


def test_units_mean_the_same_as_si_figures():
    text = GOOD
    for plain, unit in (("stiffness: 6.0e5", "stiffness: 0.6 N/um"), ("d: 0.001", "d: 1 ms")):
        assert plain in text
        text = text.replace(plain, unit, 1)
    assert parse_machine(text, "m").axes == load_machine().axes


def test_a_machine_survives_pickling():
    machine = load_machine()
    again = pickle.loads(pickle.dumps(machine))  # noqa: S301 - our own
    assert (again, again.text) == (machine, machine.text)


@pytest.mark.parametrize(
    ("effect", "figures"),
    [
        ("amplitude: 1.2, phase: 0", {"amplitude": 1.2, "phase": 0.0}),
        ("force: [1, -2.5]", {"force": (1.0, -2.5)}),
    ],
)
def test_effects_are_kept_as_names_and_figures(effect, figures):
    machine = with_effects(f"effect: cogging, {effect}")
    assert machine.axes["x"].effects == (("cogging", figures),)


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
def test_anything_else_is_refused_with_its_place(effect, problem):
    text = GOOD.replace("node: 1", f"node: 1\n    effects: [{effect}]", 1)
    with pytest.raises(ConfigError) as refused:
        parse_machine(text, "m")
    assert str(refused.value).startswith("m:12:")
    assert str(refused.value).endswith(f"axes.x.effects[1]: {problem}")
