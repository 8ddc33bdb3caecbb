"""Which alternatives are fitted further, and where fits begin."""

from __future__ import annotations

import numpy as np
import pytest

from hil_sim.effects.library import library
from sim2real.attribution.search import constant_instead, without_effect
from sim2real.fitting import NUISANCES, AxisModel, Term


def test_a_spring_takes_over_a_constant_force(nominal):
    axis = nominal[1].axes[0]
    offset = Term(library()["force_offset"], (-1.0,))
    spring = Term(library()["cable_stiffness"], (8.0, 0.01))
    wave = Term(library()["cogging"], (0.5, 0.03, 1.0))
    model = AxisModel(np.zeros(NUISANCES), (offset, wave, spring))
    fewer = without_effect(model, 0, axis)
    assert fewer.names() == ("cogging", "cable_stiffness")
    stiffness, center = fewer.terms[1].values
    assert stiffness == 8.0
    assert abs(center - 0.01) == pytest.approx(1.0 / 8.0)
    assert without_effect(model, 1, axis).terms == (offset, spring)
    assert without_effect(model, 2, axis).terms == (offset, wave)


def test_a_spring_from_beyond_the_travel_may_be_a_constant_force(nominal):
    axis, known = nominal[1].axes[0], library()
    assert axis.travel == (-0.15, 0.15)
    wave = Term(known["cogging"], (0.5, 0.03, 1.0))

    def instead(center, *others):
        spring = Term(known["cable_stiffness"], (5.0, center))
        model = AxisModel(np.zeros(NUISANCES), (spring, wave, *others))
        found = constant_instead(model, axis, known)
        return None if found is None else [(t.name, *t.values) for t in found.terms]

    there = [("cogging", 0.5, 0.03, 1.0), ("force_offset", pytest.approx(1.5))]
    assert instead(-0.3) == there
    assert instead(0.1) is None
    assert instead(-0.3, Term(known["force_offset"], (1.0,))) is None
