"""Friction over position, told in any shape from whatever else is."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from hil_sim.effects.library import library
from sim2real.attribution import FreeFormTest
from sim2real.attribution.free_form import FreeForm
from sim2real.diagnosis import examine
from tests.unit.sim2real.conftest import Nominal, stage_with

Effects = dict[str, dict[str, float]]
Likeliest = Callable[[Effects], FreeForm]


@pytest.fixture
def likeliest(nominal: Nominal) -> Likeliest:
    def form(effects: Effects) -> FreeForm:
        recording = stage_with(nominal, 21, 10.0, x=effects)
        examined = examine([recording], nominal[1])
        found = FreeFormTest("x", examined.measured, nominal[1]).most_likely(library().values())
        assert found is not None
        return found

    return form


@pytest.mark.parametrize(
    ("effects", "kind"),
    [
        (
            {"rough_stretch": {"amplitude": 0.3, "center": 0.01, "width": 0.015}},
            "friction_position",
        ),
        (
            {"friction_position": {"amplitude": -0.3, "center": -0.01, "width": 0.012}},
            "friction_position",
        ),
        (
            {"periodic_friction": {"amplitude": 0.25, "pitch": 0.008, "phase": 1.0}},
            "friction_position",
        ),
    ],
    ids=lambda of: next(iter(of)) if isinstance(of, dict) else None,
)
def test_its_kind_is_recognised_in_any_shape(
    likeliest: Likeliest, effects: Effects, kind: str
) -> None:
    form = likeliest(effects)
    assert form.effect.name == kind
    assert form.share > 0.6


@pytest.mark.parametrize(
    "effects",
    [
        {},
        {"presliding_stiffness": {"ratio": 0.6}},
        {"thermal_drift": {"amplitude": 0.3, "time_constant": 4.0}},
        {"cogging": {"amplitude": 1.5, "pitch": 0.032, "phase": 1.0}},
        *(
            pytest.param(effects, marks=pytest.mark.slow)
            for effects in (
                {"coulomb_level": {"ratio": 1.25}},
                {"two_strand_cable": {"force": 1.0, "stiffness": 4e3}},
                {"viscous_damping": {"ratio": 1.8}},
                {"cable_stiffness": {"stiffness": 12.0, "center": 0.01}},
                {"force_ripple": {"ratio": 0.06, "pitch": 0.012, "phase": 1.0}},
                {"resonance": {"frequency": 90.0, "damping": 0.02, "mass_ratio": 0.1}},
            )
        ),
    ],
    ids=lambda effects: next(iter(effects), "none"),
)
def test_nothing_else_is_of_such_a_kind(likeliest: Likeliest, effects: Effects) -> None:
    assert likeliest(effects).share < 0.4


@pytest.mark.parametrize(
    ("effect", "values"),
    [
        ("friction_position", {"amplitude": 0.4, "center": 0.012, "width": 0.01}),
    ],
)
def test_a_fit_begins_near_what_there_is(
    likeliest: Likeliest, effect: str, values: dict[str, float]
) -> None:
    form = likeliest({effect: values})
    nearest = min(
        (term.mapping() for term in form.starts),
        key=lambda start: sum(abs(start[key] - values[key]) for key in values),
    )
    for key, value in values.items():
        assert nearest[key] == pytest.approx(value, rel=0.4, abs=4e-3)
