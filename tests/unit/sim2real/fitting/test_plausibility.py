"""Which values of an effect are plausible, and which are no effect at all."""

from __future__ import annotations

import pytest

from hil_sim.effects.library import library
from sim2real.fitting import (
    Term,
    clip_to_plausible,
    implausibility,
    is_coulomb_level,
    is_within_tolerance,
)


@pytest.mark.parametrize(
    ("effect", "values", "within"),
    [
        ("payload_mass", (0.05,), True),
        ("payload_mass", (-0.3,), False),
        ("coulomb_level", (1.01,), True),
        ("coulomb_level", (0.97,), False),
        ("dead_time", (1e-6,), False),
        ("cable_stiffness", (0.1, 0.0), False),
    ],
)
def test_a_figure_off_by_tolerance_is_no_effect(nominal, effect, values, within):
    axis = nominal[1].axes[0]
    assert is_within_tolerance(Term(library()[effect], values), axis, 0.003) is within


@pytest.mark.parametrize(
    ("effect", "values", "tenths", "near"),
    [
        ("coulomb_level", (1.36,), 0.0, (1.36,)),  # of any size
        ("thermal_drift", (0.05, 20.0), 0.0, (0.05, 20.0)),  # small, but of that sign
        ("thermal_drift", (-0.03, 20.0), 1.0, (0.0, 20.0)),
        ("friction_position", (0.3, 0.0, 0.2), 5.0, (0.3, 0.0, 0.025)),
        ("cogging", (-1.0, 0.03, 0.0), 0.0, (-1.0, 0.03, 0.0)),  # half a turn
        ("force_saturation", (90.0,), 0.0, (90.0,)),
    ],
)
def test_values_beyond_what_is_plausible_are_counted(nominal, effect, values, tenths, near):
    axis = nominal[1].axes[0]
    term = Term(library()[effect], values)
    assert implausibility(term, axis) == pytest.approx(tenths, abs=1e-9)
    assert clip_to_plausible(term, axis).values == pytest.approx(near, rel=1e-12)


def test_effects_on_the_coulomb_level_are_distinguished_from_other_friction(
    nominal,
):
    axis = nominal[1].axes[0]
    middle = {
        name: Term(e, tuple(p.ranges(axis)[-1][1] for p in e.parameters))
        for name, e in library().items()
        if e.searched
    }
    courses = {name for name, term in middle.items() if is_coulomb_level(term, axis)}
    assert courses == {"coulomb_level", "thermal_drift", "friction_position"}
