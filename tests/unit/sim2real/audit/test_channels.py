"""Channels: nothing found on sound recordings, each corruption found with its figure."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from sim2real.audit import audit_channels
from sim2real.gap import combined_gap, measure_gap
from stagectl.store import read_recording
from tests.unit.sim2real.audit.conftest import first, single, spoilt
from tests.unit.sim2real.conftest import DATA


def later(samples):
    return lambda values: np.concatenate((np.repeat(values[:1], samples), values[:-samples]))


def interpolated(delay):
    def spoil(values):
        time = np.arange(len(values)) * 1e-3
        return CubicSpline(time, values)(np.clip(time - delay, 0.0, None))

    return spoil


@pytest.mark.parametrize("name", ["null-1.h5", "null-1-other-moves.h5", "null-3.h5"])
def test_sound_recordings_have_no_findings(stage, name):
    found = audit_channels(first(read_recording(DATA / name), 1200), stage)
    assert found.findings == ()
    assert found.current_paths == {}


@pytest.mark.parametrize(
    ("channels", "place", "value"),
    [
        ({"position_actual": lambda y: 1e3 * y}, ("position_actual", "units"), 1e3),
        ({"position_actual": lambda y: np.rint(y / 1e-9)}, ("position_actual", "units"), 1e9),
        ({"position_actual": lambda y: -y}, ("position_actual", "sign"), -1),
        ({"position_actual": lambda y: 1.002 * y}, ("position_actual", "scale"), 1.002),
        ({"position_actual": lambda y: y + 30e-6}, ("position_actual", "offset"), 30e-6),
        ({"position_actual": later(1)}, ("position_actual", "delay"), 1e-3),
        ({"position_actual": interpolated(0.3e-3)}, ("position_actual", "delay"), 0.3e-3),
        ({"position_demand": lambda d: 1e3 * d}, ("position_demand", "units"), 1e3),
        ({"force_actual": lambda f: 1e3 * f}, ("force_actual", "units"), 1e3),
        ({"force_actual": lambda f: f / 40 * 1e3}, ("force_actual", "units"), 25),
        ({"force_actual": lambda f: -f}, ("force_actual", "sign"), -1),
        ({"force_actual": lambda f: 1.05 * f}, ("force_actual", "scale"), 1.05),
        ({"force_actual": later(2)}, ("force_actual", "delay"), 2e-3),
        ({"force_actual": interpolated(0.4e-3)}, ("force_actual", "delay"), 0.4e-3),
        ({"force_offset": lambda f: -f}, ("force_offset", "sign"), -1),
        ({"force_offset": lambda f: 0.5 * f}, ("force_offset", "scale"), 0.5),
        (
            {"force_actual": lambda f: np.rint(f / 0.4) * 0.4},
            ("force_actual", "quantisation"), 0.4,
        ),
    ],
)  # fmt: skip
def test_each_corruption_is_named_with_its_figure(stage, recorded, channels, place, value):
    named, finding = single(audit_channels(spoilt(recorded, **channels), stage))
    assert named == ("x", *place)
    assert finding.value == pytest.approx(value, rel=0.02)
    assert not finding.applied


@pytest.mark.parametrize(
    "channels",
    [
        {"position_actual": lambda y: -1e3 * y},
        {"position_actual": later(1), "force_actual": lambda f: 1.1 * f},
        {"force_actual": later(1)},
    ],
)
def test_the_corrected_recording_has_the_gap_of_the_sound_one(stage, recorded, channels):
    sound = combined_gap(measure_gap(recorded, stage, draws=1))
    bad = spoilt(recorded, **channels)
    assert combined_gap(measure_gap(bad, stage, draws=1)) > 10 * sound
    found = audit_channels(bad, stage)
    assert combined_gap(measure_gap(found.recording, found.settings, draws=1)) < 1.5 * sound
