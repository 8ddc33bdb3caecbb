"""What the logged numbers alone give away."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from hil_sim.plant import simulate
from sim2real.audit import audit_channels
from sim2real.audit.signal_checks import check_position
from stagedata import AxisSignals, Recording
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


@pytest.fixture(scope="module")
def restless(stage):
    """A recording of sines, without any rest."""
    t = np.arange(3000) * 1e-3
    ramp = np.clip(t / 1.5, 0.0, 1.0)
    ramp = ramp**3 * (10.0 - 15.0 * ramp + 6.0 * ramp**2)
    x = 0.05 * np.sin(2 * np.pi * 0.8 * t) + 0.008 * np.sin(2 * np.pi * 2.3 * t)
    demand = np.column_stack([ramp * x, ramp * 0.04 * np.sin(2 * np.pi * 0.6 * t)])
    made = simulate(stage, demand, np.zeros_like(demand), 3)
    axes = {
        axis.name: AxisSignals(
            demand[:, a], np.zeros(len(t)), made.position[:, a], made.force[:, a], None, t >= 0.0
        )
        for a, axis in enumerate(stage.axes)
    }
    return Recording("", "", "", t, axes, (), "restless")


@pytest.mark.parametrize("scale", [1.01, 1.2, 2.0])
def test_a_scale_is_found_without_rests_and_made_exact_by_the_law(stage, restless, scale):
    found = audit_channels(spoilt(restless, position_actual=lambda y: scale * y), stage)
    named, finding = single(found)
    assert named == ("x", "position_actual", "scale")
    assert finding.value == pytest.approx(scale, rel=1e-5)
    assert not audit_channels(restless, stage).findings


@pytest.mark.parametrize("samples", [-40, -20, -2, 8, 40])
def test_forces_far_ahead_of_their_commands_are_early(stage, restless, samples):
    at = np.arange(len(restless))
    moved = spoilt(restless, force_actual=lambda f: np.interp(at - samples, at, f))
    named, finding = single(audit_channels(moved, stage))
    assert named == ("x", "force_actual", "delay")
    assert finding.value == pytest.approx(samples * 1e-3, abs=2e-5)


@pytest.mark.parametrize("lag", [0.01, 0.1])
@pytest.mark.parametrize("scale", [1.0, 1.2])
def test_a_loop_that_lags_is_no_scale(stage, lag, scale):
    """Its amplitude is smaller: at 0.3 Hz and 0.1 s by 2 %."""
    t = np.arange(20_000) * 1e-3
    demand = 0.1 * np.sin(2 * np.pi * 0.3 * t)
    keep = lag / (lag + 1e-3)
    actual = scale * lfilter([1.0 - keep], [1.0, -keep], demand)
    signals = AxisSignals(demand, 0.0 * t, actual, 0.0 * t, None, t >= 0.0)
    found = check_position(signals, stage.axes[0], 1e-3)
    assert [f.value for f in found] == [pytest.approx(scale, rel=0.04)] * (scale != 1.0)


def test_a_loop_that_has_not_settled_is_no_scale(stage, recorded):
    """A slow integrator leaves each rest some micrometres off, to the side that it came from."""
    signals = recorded.axes["x"]
    rng = np.random.default_rng(3)
    rests = rng.uniform(-0.03, 0.03, 25)
    left = -2e-5 * np.sign(np.diff(rests, prepend=0.0))
    demand = np.repeat(rests, 40)
    fading = np.exp(-np.tile(np.arange(40), 25) / 60.0)
    ramped = np.convolve(np.pad(demand, (3, 3), "edge"), np.ones(7) / 7.0, "valid")
    actual = ramped + np.repeat(left, 40) * fading
    axis = stage.axes[0]

    def found(scale):
        slow = replace(
            signals, position_demand=ramped, position_actual=scale * actual,
            valid=np.ones(len(ramped), dtype=bool),
        )  # fmt: skip
        return [f.finding for f in check_position(slow, axis, 4e-3)]

    assert found(1.0) == []
    assert found(1.005) == ["scale"]
