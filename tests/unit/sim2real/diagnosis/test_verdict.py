"""What may be concluded: a large gap is never none, however large the floor of its model."""

from __future__ import annotations

from dataclasses import replace

from sim2real.diagnosis import diagnose, examine
from sim2real.diagnosis.reason import describe_far_off
from sim2real.gap import combined_floors, compare_with_model
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
