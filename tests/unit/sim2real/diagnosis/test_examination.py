"""What is known before any effect is suspected, and when there can be no diagnosis."""

from dataclasses import replace

import numpy as np
import pytest

from hil_sim.plant import simulate
from sim2real.diagnosis import examine
from sim2real.diagnosis.examination import report_without_causes, why_insufficient
from stagectl.store import read_recording
from tests.unit.sim2real.conftest import DATA


@pytest.fixture(scope="module")
def recorded(recorded):
    return cut(recorded, slice(0, 2500))


def cut(recorded, places):
    """The recording with these samples only, times as they were."""
    axes = {
        name: replace(
            s, position_demand=s.position_demand[places], force_offset=s.force_offset[places],
            position_actual=s.position_actual[places], force_actual=s.force_actual[places],
            statusword=None, valid=s.valid[places],
        )
        for name, s in recorded.axes.items()
    }  # fmt: skip
    return replace(recorded, time=recorded.time[places], axes=axes, moves=())


def on_x(recorded, **channels):
    x = replace(recorded.axes["x"], **channels)
    return replace(recorded, axes={**recorded.axes, "x": x})


def test_a_sound_recording_has_hardly_a_gap(stage, recorded):
    report = report_without_causes(examine([recorded], stage))
    for signals in report.gap.values():
        for figures in signals.values():
            assert figures.nominal < 4.0 * figures.floor
    assert report.channels == ()
    assert report.to_json()["gap"]["x"]["force"].keys() == {"nominal", "floor", "unit"}


def test_a_stage_that_is_otherwise_has_one_and_it_is_not_given_a_name(stage, recorded):
    heavy = replace(stage, axes=(replace(stage.axes[0], mass=8.4), stage.axes[1]))
    demand = np.column_stack([a.position_demand for a in recorded.axes.values()])
    offset = np.column_stack([a.force_offset for a in recorded.axes.values()])
    response = simulate(heavy, demand, offset, 4)
    made = on_x(
        recorded, position_actual=response.position[:, 0], force_actual=response.force[:, 0]
    )
    report = report_without_causes(examine([made], stage))
    assert (report.verdict, report.causes) == ("unexplained", ())
    assert report.where[0].axis == "x"


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda r: cut(r, slice(0, None, 100)), "10 Hz"),
        (lambda r: cut(r, slice(0, 800)), "0.8 s long"),
        (lambda r: cut(r, slice(0, 1)), "1 samples"),
        (lambda r: cut(r, np.r_[np.zeros(2000, int)]), "no motion"),
        (lambda r: on_x(r, valid=np.arange(len(r)) % 3 == 0), "33 % of the samples are valid"),
        (lambda r: on_x(r, force_actual=np.full(len(r), 1e300)), "force_actual reaches 1e"),
    ],
)
def test_recordings_that_support_no_diagnosis(stage, recorded, spoil, words):
    made = spoil(recorded)
    if words == "no motion":
        made = replace(made, time=np.arange(len(made)) * 1e-3)
    report = report_without_causes(examine([made], stage))
    assert report.verdict == "insufficient"
    assert words in report.reason
    assert report.causes == ()


def test_what_is_too_short_for_a_diagnosis_still_has_a_gap_and_a_place(stage, recorded):
    heavy = replace(stage, axes=(replace(stage.axes[0], mass=9.0), *stage.axes[1:]))
    report = report_without_causes(examine([cut(recorded, slice(0, 800))], heavy))
    assert report.verdict == "insufficient"
    assert report.gap["x"]["force"].nominal > 5.0 * report.gap["x"]["force"].floor
    assert report.where
    slow = report_without_causes(examine([cut(recorded, slice(0, None, 100))], stage))
    assert (slow.gap, slow.where) == ({}, ())


def test_one_move_is_not_enough(stage, recorded):
    assert "1 move" in why_insufficient(
        replace(recorded, moves=read_recording(DATA / "null-2.h5").moves[:1]), stage
    )


def test_a_fault_of_a_channel_is_no_physics_unless_it_is_corrected(stage, recorded):
    first = replace(cut(recorded, slice(0, 1200)), moves=())
    bad = on_x(first, force_actual=-first.axes["x"].force_actual)
    report = report_without_causes(examine([bad], stage))
    assert report.verdict == "insufficient"
    assert "force_actual has the wrong sign" in report.reason
    assert report.gap["x"]["force"].nominal > 5.0 * report.gap["x"]["force"].floor
    assert [(f.finding, f.applied) for f in report.channels] == [("sign", False)]
    corrected = report_without_causes(examine([bad], stage, correct=True))
    assert corrected.verdict != "insufficient"
    assert [(f.finding, f.applied) for f in corrected.channels] == [("sign", True)]


def test_recordings_together_are_one_gap_and_a_name_in_errors(stage, recorded):
    first = cut(recorded, slice(0, 1200))
    examined = examine([first, replace(first, source="other")], stage)
    assert len(examined.measured) == 2
    alone = examine([first], stage)
    for axis, signals in alone.gap.items():
        for signal, figures in signals.items():
            assert examined.gap[axis][signal].nominal == pytest.approx(figures.nominal)
    late = replace(first, time=first.time * 1.3, source="late.h5")
    with pytest.raises(ValueError, match=r"late\.h5: its samples are 0\.0013 s apart"):
        examine([first, late], stage)
