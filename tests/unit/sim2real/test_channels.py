"""Channels: nothing found on sound recordings, each corruption found with its figure."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from hil_sim.plant.simulate import simulate
from sim2real.audit import audit
from sim2real.gap import combined, measure
from stagectl.config import load_machine, stage_settings
from stagectl.store.recording import read_recording

DATA = Path(__file__).parents[2] / "data"
SAMPLES = 1000


def first(recorded, samples=SAMPLES):
    axes = {
        name: replace(
            signals,
            **{
                channel: getattr(signals, channel)[:samples]
                for channel in (
                    "position_demand", "force_offset", "position_actual", "force_actual",
                    "statusword", "valid",
                )
            },
        )
        for name, signals in recorded.axes.items()
    }  # fmt: skip
    moves = tuple(m for m in recorded.moves if m.end <= samples)
    return replace(recorded, time=recorded.time[:samples], axes=axes, moves=moves)


@pytest.fixture(scope="module")
def stage():
    return stage_settings(load_machine())


@pytest.fixture(scope="module")
def recorded():
    return first(read_recording(DATA / "null-2.h5"))


def spoilt(recorded, **channels):
    """The x axis with channels replaced by functions of what they were."""
    x = recorded.axes["x"]
    changed = {name: spoil(getattr(x, name)) for name, spoil in channels.items()}
    return replace(recorded, axes={**recorded.axes, "x": replace(x, **changed)})


def later(samples):
    return lambda values: np.concatenate((np.repeat(values[:1], samples), values[:-samples]))


def interpolated(delay):
    def spoil(values):
        time = np.arange(len(values)) * 1e-3
        return CubicSpline(time, values)(np.clip(time - delay, 0.0, None))

    return spoil


def single(found):
    (finding,) = found.findings
    return (finding.axis, finding.channel, finding.finding), finding


@pytest.mark.parametrize("name", ["null-1.h5", "null-1-other-moves.h5", "null-3.h5"])
def test_sound_recordings_have_no_findings(stage, name):
    found = audit(first(read_recording(DATA / name), 1200), stage)
    assert found.findings == ()
    assert found.path == {}


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
    named, finding = single(audit(spoilt(recorded, **channels), stage))
    assert named == ("x", *place)
    assert finding.value == pytest.approx(value, rel=0.02)
    assert not finding.applied


def test_a_coarse_encoder_is_told_beside_what_it_does_to_nothing_else(stage, recorded):
    coarse = spoilt(recorded, position_actual=lambda y: np.rint(y / 2e-8) * 2e-8)
    found = {(f.channel, f.finding): f.value for f in audit(coarse, stage).findings}
    assert found[("position_actual", "quantisation")] == pytest.approx(2e-8)


def test_setpoints_that_act_a_period_late(stage, recorded):
    early = {name: lambda v: np.concatenate((v[1:], v[-1:])) for name in
             ("position_demand", "force_offset")}  # fmt: skip
    named, finding = single(audit(spoilt(recorded, **early), stage))
    assert named == ("x", "position_demand", "delay")
    assert finding.value == pytest.approx(1e-3, rel=0.01)


@pytest.mark.parametrize(
    ("spoil", "kind", "value"),
    [
        (lambda t: 1e3 * t, "units", 1e3),
        (lambda t: t * (1 + 2e-4), "clock", 2e-4),
        (lambda t: t + np.random.default_rng(1).normal(0, 1e-4, len(t)), "jitter", 1e-4),
    ],
)
def test_time_axis(stage, recorded, spoil, kind, value):
    found = audit(replace(recorded, time=spoil(recorded.time)), stage)
    named, finding = single(found)
    assert named == ("all", "time", kind)
    assert finding.value == pytest.approx(value, rel=0.05)
    np.testing.assert_allclose(found.recording.time, recorded.time, atol=1e-9)


def test_an_encoder_clock_that_drifts(stage, recorded):
    time = np.arange(SAMPLES) * 1e-3
    drifting = spoilt(recorded, position_actual=lambda y: CubicSpline(time, y)(time * (1 - 1e-4)))
    named, finding = single(audit(drifting, stage))
    assert named == ("x", "position_actual", "clock")
    assert finding.value == pytest.approx(1e-4, rel=0.05)


def with_control(stage, **factors):
    x = stage.axes[0]
    control = replace(x.control, **{k: getattr(x.control, k) * f for k, f in factors.items()})
    return replace(stage, axes=(replace(x, control=control), stage.axes[1]))


def test_a_controller_with_other_gains_is_named_and_corrected_for(stage, recorded):
    found = audit(recorded, with_control(stage, kp=1.25))
    named, finding = single(found)
    assert named == ("x", "force_actual", "controller_kp")
    assert finding.value == pytest.approx(0.8, rel=0.01)
    assert found.settings.axes[0].control.kp == pytest.approx(stage.axes[0].control.kp, rel=0.01)
    both = audit(recorded, with_control(stage, kd=1.25, ki=2.0))
    assert {f.finding for f in both.findings} == {"controller_kd", "controller_ki"}


def test_a_controller_of_another_kind_is_told_by_what_is_left(stage, recorded):
    odd = spoilt(recorded, force_actual=lambda f: f + 2 * np.sin(np.arange(len(f))))
    (finding,) = [f for f in audit(odd, stage).findings if f.finding != "quantisation"]
    assert (finding.finding, finding.unit) == ("controller", "N")
    assert finding.value == pytest.approx(np.sqrt(2), rel=0.05)


def test_the_stages_own_current_loop_is_no_fault_of_a_channel(stage, recorded):
    slow = with_control(stage, current_bandwidth=0.15)
    demand = np.column_stack([a.position_demand for a in recorded.axes.values()])
    offset = np.column_stack([a.force_offset for a in recorded.axes.values()])
    response = simulate(slow, demand, offset, 3)
    x = replace(
        recorded.axes["x"],
        position_actual=response.position[:, 0], force_actual=response.force[:, 0],
    )  # fmt: skip
    found = audit(replace(recorded, axes={**recorded.axes, "x": x}), stage)
    assert found.findings == ()
    assert found.path["x"].bandwidth == pytest.approx(225, rel=0.01)
    assert found.path["x"].dead_time is None


def test_saturation_is_told_with_its_duty(stage, recorded):
    clipped = spoilt(recorded, force_actual=lambda f: np.clip(f, -20, 20))
    found = {f.finding: f.value for f in audit(clipped, stage).findings}
    duty = np.mean(np.abs(recorded.axes["x"].force_actual) >= 20)
    assert found["saturation"] == pytest.approx(duty, rel=0.2)


@pytest.mark.parametrize(
    "channels",
    [
        {"position_actual": lambda y: -1e3 * y},
        {"position_actual": later(1), "force_actual": lambda f: 1.1 * f},
        {"force_actual": later(1)},
    ],
)
def test_the_corrected_recording_has_the_gap_of_the_sound_one(stage, recorded, channels):
    sound = combined(measure(recorded, stage, draws=1))
    bad = spoilt(recorded, **channels)
    assert combined(measure(bad, stage, draws=1)) > 10 * sound
    found = audit(bad, stage)
    assert combined(measure(found.recording, found.settings, draws=1)) < 1.5 * sound


def test_a_drive_that_runs_into_its_peak_force_is_no_other_controller(stage, recorded):
    """The clamp and the integrator's halt belong to the law: only saturation is told."""
    x = stage.axes[0]
    weak = replace(x, control=replace(x.control, peak_force=45.0))
    weak = replace(stage, axes=(weak, stage.axes[1]))
    demand = np.column_stack([a.position_demand for a in recorded.axes.values()])
    offset = np.column_stack([a.force_offset for a in recorded.axes.values()])
    heavy = replace(weak, axes=(replace(weak.axes[0], mass=13.0), weak.axes[1]))
    response = simulate(heavy, demand, offset, 3)
    made = spoilt(
        recorded,
        position_actual=lambda _: response.position[:, 0],
        force_actual=lambda _: response.force[:, 0],
    )
    assert np.abs(response.force[:, 0]).max() > 44.9
    named, finding = single(audit(made, weak))
    assert named == ("x", "force_actual", "saturation")
    assert finding.value == pytest.approx(np.mean(np.abs(response.force[:, 0]) > 44.7), rel=0.3)


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
    found = audit(replace(holed, time=late), stage)
    assert [f.finding for f in found.findings if f.channel != "time"] == []
    np.testing.assert_array_equal(np.rint(found.recording.time / 1e-3), np.arange(SAMPLES))
