"""What may be concluded: a large gap is never none, however large the floor of its model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hil_sim.effects.library import library
from sim2real.diagnosis import diagnose, examine
from sim2real.diagnosis.reason import describe_far_off
from sim2real.diagnosis.verdict import doubt_rest
from sim2real.findings import Cause
from sim2real.fitting import NUISANCES, AxisModel, Term
from sim2real.gap import combined_floors, compare_with_model
from sim2real.held_out import HeldOut, Remaining
from sim2real.scoring.constants import DOUBTED
from tests.unit.sim2real.conftest import TOLERANCE, stage_with


def test_a_gap_as_large_as_the_motion_is_never_none(nominal):
    recording, settings = stage_with(nominal, 3), nominal[1]
    sound = examine([recording], settings)
    assert describe_far_off(sound) == ""
    fine = diagnose(sound, TOLERANCE, {}).report
    assert fine.verdict == "no_gap"
    assert f"is {combined_floors(fine.gap):.3g} times the floor" in fine.reason, "one figure for it"

    x = recording.axes["x"]
    middle = x.position_demand.mean()
    elsewhere = replace(x, position_actual=middle + 0.8 * (x.position_actual - middle))
    far = replace(recording, axes={**recording.axes, "x": elsewhere})
    # A floor as large as the gap, as of a model that hardly follows.
    found = compare_with_model(far, settings)
    wide = {
        axis: {name: 3.0 * f.nominal for name, f in signals.items()}
        for axis, signals in found.gap.items()
    }
    measured = replace(found, floor=replace(found.floor, rms=wide))
    examined = replace(sound, measured=(measured,), gap=found.gap)
    assert "the position of x is simulated" in describe_far_off(examined)
    report = diagnose(examined, TOLERANCE, {}).report
    assert report.verdict == "unexplained"
    assert "the position of x is simulated" in report.reason


@pytest.mark.parametrize(("left", "stays"), [(0.1, True), (4.0, False)])
def test_a_cause_that_closes_nothing_without_a_doubted_one_is_doubted(left, stays):
    # As of a level and a bump that make up a slope between them.
    shape = (12, 2)
    samples = np.full(shape, 100.0)
    before = 50.0 * samples
    asked = []

    def leaves(folds):
        asked.extend(tuple(models["x"].names()) for models in folds)
        return Remaining(left * before, {})

    terms = tuple(
        Term(effect, tuple(0.01 for _ in effect.parameters))
        for effect in (library()["coulomb_level"], library()["friction_position"])
    )
    model = AxisModel(np.zeros(NUISANCES), terms)
    held_out = HeldOut(
        samples, before, [{"x": model}], leaves, Remaining(samples, {}), {}, {"x": slice(None)}, ()
    )
    level, bump = (
        Cause("x", term.name, probability, {}, None, None)
        for term, probability in zip(terms, (0.9, 0.4), strict=True)
    )
    found = doubt_rest([level, bump], held_out)
    assert asked == [("coulomb_level",)]
    assert [cause.probability for cause in found] == ([0.9, 0.4] if stays else [DOUBTED, 0.4])
    sure = replace(bump, probability=0.9)
    assert doubt_rest([level, sure], held_out) == [level, sure], "all are named: each is needed"
