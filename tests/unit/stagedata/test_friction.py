"""Friction figures: ranges by law, derived figures, copies with other figures."""

from dataclasses import replace

import pytest

from stagedata import FrictionFigures

GMS = FrictionFigures(10, 6.0, 20.0, 6e5, 100.0, 0.4, 2e-3, 1.0)
COULOMB = FrictionFigures(0, 6.0, 20.0, 0.0, 0.0, 0.4, 2e-3, 1.0, law="coulomb")


@pytest.mark.parametrize(
    ("figures", "name", "value"),
    [
        (GMS, "elements", 65),
        (GMS, "elements", 0),
        (GMS, "stiffness", 0.0),
        (GMS, "relaxation_rate", float("inf")),
        (GMS, "static_ratio", -1.0),
        (GMS, "viscous", -1.0),
        (GMS, "law", "lugre"),
        (COULOMB, "coulomb", 0.0),
        (COULOMB, "stribeck_velocity", float("nan")),
        (COULOMB, "stiffness", 6e5),
        (COULOMB, "elements", 10),
    ],
)
def test_a_figure_outside_its_range_is_named(figures, name, value):
    with pytest.raises(ValueError, match=f"^{name}: "):
        replace(figures, **{name: value})


def test_a_law_has_its_own_figures_only():
    assert all(GMS.has(name) for name in ("coulomb", "stiffness", "attraction", "elements"))
    assert COULOMB.has("static_ratio")
    assert not any(COULOMB.has(name) for name in ("stiffness", "relaxation_rate", "attraction"))
    assert COULOMB.attraction == 0.0


def test_scaling_keeps_the_relaxation_rate():
    half = GMS.scaled(0.5)
    assert (half.coulomb, half.viscous, half.stiffness) == (3.0, 10.0, 3e5)
    assert (half.relaxation_rate, half.attraction) == (100.0, 300.0)
    assert COULOMB.scaled(0.5).coulomb == 3.0


def test_attraction_is_taken_at_the_coulomb_force_that_comes_with_it():
    changed = GMS.with_figures({"coulomb": 3.0, "attraction": 600.0, "viscous": 21.0})
    assert (changed.attraction, changed.relaxation_rate, changed.viscous) == (600.0, 200.0, 21.0)
    assert GMS.with_figures({"attraction": 300.0}).relaxation_rate == 50.0
