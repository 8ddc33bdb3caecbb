"""What the logged numbers alone give away."""

from dataclasses import replace

import numpy as np
import pytest

from sim2real.audit import audit_channels
from tests.unit.sim2real.audit.conftest import SAMPLES, single, spoilt


def test_a_coarse_encoder_is_reported_with_its_step(stage, recorded):
    coarse = spoilt(recorded, position_actual=lambda y: np.rint(y / 2e-8) * 2e-8)
    found = {(f.channel, f.finding): f.value for f in audit_channels(coarse, stage).findings}
    assert found[("position_actual", "quantisation")] == pytest.approx(2e-8)


@pytest.mark.parametrize(
    ("spoil", "kind", "value"),
    [
        (lambda t: 1e3 * t, "units", 1e3),
        (lambda t: t * (1 + 2e-4), "clock", 2e-4),
        (lambda t: t + np.random.default_rng(1).normal(0, 1e-4, len(t)), "jitter", 1e-4),
    ],
)
def test_time_axis(stage, recorded, spoil, kind, value):
    found = audit_channels(replace(recorded, time=spoil(recorded.time)), stage)
    named, finding = single(found)
    assert named == ("all", "time", kind)
    assert finding.value == pytest.approx(value, rel=0.05)
    np.testing.assert_allclose(found.recording.time, recorded.time, atol=1e-9)


def test_saturation_is_reported_with_its_duty(stage, recorded):
    clipped = spoilt(recorded, force_actual=lambda f: np.clip(f, -20, 20))
    found = {f.finding: f.value for f in audit_channels(clipped, stage).findings}
    duty = np.mean(np.abs(recorded.axes["x"].force_actual) >= 20)
    assert found["saturation"] == pytest.approx(duty, rel=0.2)


def test_missed_samples_and_late_stamps_are_no_fault(stage, recorded):
    rng = np.random.default_rng(2)
    valid = rng.random(SAMPLES) > 0.03
    valid[:2] = True
    held = np.maximum.accumulate(np.where(valid, np.arange(SAMPLES), 0))
    holed = spoilt(
        recorded, position_actual=lambda y: y[held], force_actual=lambda f: f[held],
        valid=lambda _: valid,
    )  # fmt: skip
    late = recorded.time.copy()
    late[400] += 3.2e-3  # one stamp late by three periods, and the next ones close behind
    late = np.maximum.accumulate(late) + np.arange(SAMPLES) * 1e-12
    found = audit_channels(replace(holed, time=late), stage)
    assert [f.finding for f in found.findings if f.channel != "time"] == []
    np.testing.assert_array_equal(np.rint(found.recording.time / 1e-3), np.arange(SAMPLES))
