"""Which effects of a machine file the host makes up for, and what it does where it cannot."""

import pytest

from estimation.known_effects import KnownTerms
from hil_sim.effects.library import own_effects
from stagectl.config import load_machine, stage_settings
from stagectl.config.settings.known_effects import axis_as_known, known_effects, known_terms
from stagectl.errors import ConfigError
from tests.unit.stagectl.machines import with_effects

PACKAGE = '''
from hil_sim.effects import Compensation, Effect, Parameter


class Bellows(Effect):
    """A bellows that is compressed by moving."""

    name = "bellows"
    group = "force"
    parameters = (Parameter("stiffness", "N/m", "of the bellows", (5.0, 20.0), neutral=0.0),)
    equation = "F_d += stiffness x"
    enters = "A disturbance force over position."
    remedy = "A longer bellows."
    compensation = Compensation("fed forward over position", "bellows:inverse")

    def apply(self, ports, parameters):
        ports.spring += parameters["stiffness"]


class Draught(Bellows):
    name = "draught"
    compensation = Effect.compensation


class Broken(Bellows):
    name = "broken"
    compensation = Compensation("fed forward over position", "bellows:missing")


def inverse(terms, values):
    terms.forces.append(lambda x: values["stiffness"] * x)
'''


def machine(*effects):
    return with_effects(*effects, node=2, more="    rotary: true\n")


@pytest.fixture
def bellows(install):
    of = {name.lower(): f"bellows:{name}" for name in ("Bellows", "Draught", "Broken")}
    install("bellows", PACKAGE, "stagectl.effects", **of)


def test_every_effect_of_the_library_says_whether_it_is_compensated_and_how():
    assert (known_effects(load_machine()), known_terms(load_machine())) == ((), {})
    axis = stage_settings(load_machine()).axes[1]
    left = set()
    for name, effect in own_effects().items():
        values = {
            p.key: [0.5, 1.0] if p.role == "table" else p.ranges(axis)[-1][1]
            for p in effect.parameters
        }
        values |= {"width": [10.0, 20.0]} if name == "motor_hysteresis_table" else {}
        text = ", ".join([f"effect: {name}", *(f"{k}: {v!r}" for k, v in values.items())])
        one = machine(text)
        (found,) = known_effects(one)
        assert (found.axis, found.effect) == ("y", name)
        assert not found.text.endswith(".")
        assert not known_effects(one, compensating=False)[0].compensated
        assert (known_terms(one).get("y", KnownTerms()) != KnownTerms()) is found.compensated, name
        if not found.compensated:
            left.add(name)
    tables = {"motor_loss_table", "motor_hysteresis_table", "misreading_table"}
    assert left == {"floor_vibration", "load_friction", "resonance", *tables}


def test_mass_and_current_loop_are_those_that_are_known():
    known = machine("effect: payload_mass, mass: 1.5", "effect: current_bandwidth, bandwidth: 300")
    axis = axis_as_known(known.axes["y"], known_terms(known)["y"])
    assert axis.plant.mass == 15.5
    assert axis.drive.current_bandwidth == 300.0
    assert known.axes["y"].plant.mass == 14.0


def test_another_package_declares_how_or_is_said_not_to_be_compensated(bellows):
    found = known_effects(machine("effect: bellows, stiffness: 8", "effect: draught, stiffness: 8"))
    assert [(e.effect, e.compensated) for e in found] == [("bellows", True), ("draught", False)]
    assert found[1].describe() == ("y: draught is not compensated: its package does not say how")
    (force,) = known_terms(machine("effect: bellows, stiffness: 8"))["y"].forces
    assert force(0.5) == 4.0


def test_an_inverse_that_cannot_be_used_is_named_in_a_line(bellows):
    with pytest.raises(ConfigError, match=r"m.yaml: axes.y.effects: broken: its inverse bellows:m"):
        known_terms(machine("effect: broken, stiffness: 8"))


def test_a_key_that_is_missing_is_named_with_its_line():
    with pytest.raises(ConfigError, match=r"m.yaml:\d+.*axes.y.effects\[1\].*phase is missing"):
        known_terms(machine("effect: cogging, amplitude: 1, pitch: 0.03"))


def test_what_a_friction_map_has_is_left_to_it():
    bump = machine(
        "effect: friction_position, amplitude: 0.4, center: 0, width: 0.01",
        "effect: friction_asymmetry, ratio: 0.1",
    )
    assert known_terms(bump)["y"].table_factors
    terms = known_terms(bump, mapped=True)["y"]
    assert not terms.table_factors
    assert terms.forward == 1.1
    assert [e.compensated for e in known_effects(bump, mapped=True)] == [False, True]
