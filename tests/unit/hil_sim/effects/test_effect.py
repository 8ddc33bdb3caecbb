"""What every effect is checked for before it may write into the plant."""

import math

import pytest

from hil_sim.effects import Effect, Parameter

MASS = Parameter("mass", "kg", "added mass", (0.1, 2.0), neutral=0.0, above=-5.0, below=100.0)
COUNT = Parameter("count", "", "how many", (1.0, 3.0), role="shape", least=1.0)


class Loaded(Effect):
    """Something heavy.

    A wafer chuck.
    """

    name, group, parameters = "loaded", "mass", (MASS, COUNT)
    equation = enters = remedy = ""

    def apply(self, ports, parameters):
        if parameters["mass"] > 50.0:
            raise ValueError("the carriage breaks")
        ports.append(parameters)

    def refusal(self, parameters, axis):
        return "too heavy for this axis" if parameters["mass"] > axis.mass else None


@pytest.mark.parametrize(
    ("parameter", "value", "reason"),
    [
        (MASS, -5.0, "must be > -5 kg, is -5"),
        (MASS, 100.0, "must be < 100 kg, is 100"),
        (COUNT, 0.999, "must be >= 1, is 0.999"),
        (MASS, math.nan, None),
        (MASS, math.inf, None),
    ],
)
def test_a_value_outside_its_physical_limits_is_refused_with_the_limit(parameter, value, reason):
    said = parameter.refusal(value)
    assert said is not None
    assert reason is None or said == reason


def test_limits_are_open_or_closed_as_they_say():
    assert MASS.refusal(-4.999) is MASS.refusal(99.999) is COUNT.refusal(1.0) is None


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ({"mass": 1.0}, "count: is missing"),
        ({"mass": 1.0, "count": 1.0, "size": 2.0}, "size: not a key of loaded; it has mass, count"),
        ({"mass": 1.0, "count": 0.0}, "count: must be >= 1, is 0"),
    ],
)
def test_exactly_its_keys_are_taken(values, reason):
    with pytest.raises(ValueError, match=reason.replace("(", r"\(")):
        Loaded().at(**values)


def test_the_axis_may_refuse_values_that_are_physical_elsewhere(nominal):
    axis = nominal.axes[0]
    Loaded().check({"mass": 5.0, "count": 1.0}, axis)
    with pytest.raises(ValueError, match=r"too heavy for this axis"):
        Loaded().check({"mass": 9.0, "count": 1.0}, axis)


def test_an_applied_effect_keeps_its_values_in_the_order_of_its_parameters():
    applied = Loaded().at(count=2.0, mass=1.0)
    assert applied.values == (("mass", 1.0), ("count", 2.0))
    assert applied.parameters == {"mass": 1.0, "count": 2.0}


def test_a_refusal_on_applying_names_the_effect(nominal):
    class Ports(list):
        axis = nominal.axes[1]

    ports = Ports()
    Loaded().at(mass=1.0, count=1.0).apply(ports)
    assert ports == [{"mass": 1.0, "count": 1.0}]
    with pytest.raises(ValueError, match=r"^loaded: too heavy for this axis"):
        Loaded().at(mass=60.0, count=1.0).apply(ports)


def test_its_origin_is_its_docstring_on_one_line():
    assert Loaded.origin() == "Something heavy. A wafer chuck."
