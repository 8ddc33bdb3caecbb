"""What was found is worth as much on other recordings as it is right."""

from dataclasses import replace

import numpy as np
import pytest

from hil_sim.effects.library import library
from sim2real.diagnosis import Diagnosis, continue_clock, examine, judge_elsewhere
from sim2real.diagnosis.examination import report_without_causes
from sim2real.findings import Cause, SelectionStep
from sim2real.fitting import NUISANCES, AxisModel, Term
from tests.unit.sim2real.conftest import stage_with

COGGING = {"amplitude": 1.2, "pitch": 0.032, "phase": 0.5}
OFFSET = {"force": 1.0}


def model(**effects):
    terms = tuple(Term(library()[name], tuple(of.values())) for name, of in effects.items())
    return AxisModel(np.zeros(NUISANCES), terms)


@pytest.fixture(scope="module")
def others(nominal):
    recorded = stage_with(nominal, 5, x={"cogging": COGGING, "force_offset": OFFSET})
    return examine([recorded], nominal[1])


def found(others, *steps):
    """A diagnosis of x whose steps have these models; the last one is what it found."""
    names = steps[-1].names() if steps else ()
    causes = tuple(Cause("x", name, 0.9, {}, 0.9, None) for name in names)
    listed = tuple(SelectionStep("x", s.names()[-1:], s.names(), 0.9, 0.01) for s in steps)
    report = replace(report_without_causes(others), causes=causes, steps=listed)
    models = {"x": steps[-1]} if steps else {}
    return Diagnosis(report, models, {}, steps={"x": steps})


def test_each_step_is_judged_with_its_own_figures(others):
    right = model(force_offset=OFFSET, cogging=COGGING)
    report = judge_elsewhere(found(others, model(force_offset=OFFSET), right), others)
    first, second = (step.elsewhere for step in report.steps)
    assert 0.05 < first < 0.8
    assert second > 0.95
    assert report.gap_closed_elsewhere > 0.9
    assert report.to_json()["steps"][1]["elsewhere"] == second


@pytest.mark.parametrize(
    ("figures", "verdict"),
    [(COGGING, "explained"), ({**COGGING, "amplitude": 0.6}, "partly_explained")],
)
def test_what_explains_too_little_elsewhere_explains_partly(others, figures, verdict):
    diagnosis = found(others, model(force_offset=OFFSET, cogging=figures))
    explained = replace(diagnosis.report, verdict="explained", reason="all of it")
    report = judge_elsewhere(replace(diagnosis, report=explained), others)
    assert report.verdict == verdict
    share = f"{100 * report.gap_closed_elsewhere:.0f} %"
    assert report.reason == f"all of it; on the recordings of --check {share}"


def test_wrong_figures_close_less_than_nothing(others):
    wrong = model(force_offset={"force": -1.0})
    report = judge_elsewhere(found(others, wrong), others)
    assert report.steps[0].elsewhere < 0.0
    assert report.gap_closed_elsewhere < 0.0


def test_a_wave_may_have_another_phase_elsewhere_which_is_said(others):
    turned = model(force_offset=OFFSET, cogging={**COGGING, "phase": 2.4})
    report = judge_elsewhere(found(others, turned), others)
    assert report.gap_closed_elsewhere > 0.9
    assert report.steps[0].elsewhere > 0.9
    assert report.reason.endswith(", with the phase of cogging on x fitted anew there")


def test_a_gap_no_larger_than_the_floor_is_no_gap_to_close(others):
    (m,) = others.measured
    high = {axis: {s: 100.0 * v for s, v in of.items()} for axis, of in m.floor.rms.items()}
    quiet = replace(others, measured=(replace(m, floor=replace(m.floor, rms=high)),))
    report = judge_elsewhere(found(quiet, model(cogging=COGGING)), quiet)
    assert report.gap_closed_elsewhere is None
    assert "elsewhere" not in report.to_json()["steps"][0]


def test_without_causes_there_is_nothing_to_judge(others):
    diagnosis = found(others)
    assert judge_elsewhere(diagnosis, others) is diagnosis.report


def test_what_has_faded_is_not_there_in_a_later_recording(nominal):
    """The drift of a first recording, at a time when nothing is left of it."""
    first = replace(nominal[0], started="2026-03-01T10:00:00+01:00")
    later = replace(
        stage_with(nominal, 6, x={"force_offset": OFFSET}), started="2026-03-01T10:04:00+01:00"
    )
    drift = {"amplitude": 0.3, "time_constant": 20.0}
    right = model(force_offset=OFFSET, thermal_drift=drift)
    clock = continue_clock([first], [later])
    assert clock.starts == (240.0,)
    on_clock = examine([later], nominal[1], clock=clock)
    anew = examine([later], nominal[1])
    closed = [judge_elsewhere(found(o, right), o).gap_closed_elsewhere for o in (on_clock, anew)]
    assert closed[0] > 0.95
    assert closed[1] < 0.9
    assert continue_clock([nominal[0]], [later]).starts == (0.0,)
