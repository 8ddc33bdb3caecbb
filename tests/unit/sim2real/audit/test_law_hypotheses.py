"""Which error of timing or gain explains the logged force."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from hil_sim.effects.library import library
from hil_sim.plant import simulate
from sim2real.audit import audit_channels
from stagectl.store import read_recording
from tests.unit.sim2real.audit.conftest import SAMPLES, single, spoilt
from tests.unit.sim2real.conftest import DATA


def test_setpoints_that_act_a_period_late(stage, recorded):
    early = {name: lambda v: np.concatenate((v[1:], v[-1:])) for name in
             ("position_demand", "force_offset")}  # fmt: skip
    named, finding = single(audit_channels(spoilt(recorded, **early), stage))
    assert named == ("x", "position_demand", "delay")
    assert finding.value == pytest.approx(1e-3, rel=0.01)


def test_an_encoder_clock_that_drifts(stage, recorded):
    time = np.arange(SAMPLES) * 1e-3
    drifting = spoilt(recorded, position_actual=lambda y: CubicSpline(time, y)(time * (1 - 1e-4)))
    named, finding = single(audit_channels(drifting, stage))
    assert named == ("x", "position_actual", "clock")
    assert finding.value == pytest.approx(1e-4, rel=0.05)


def with_control(stage, **factors):
    x = stage.axes[0]
    control = replace(x.control, **{k: getattr(x.control, k) * f for k, f in factors.items()})
    return replace(stage, axes=(replace(x, control=control), stage.axes[1]))


def test_a_controller_with_other_gains_is_named_and_corrected_for(stage, recorded):
    found = audit_channels(recorded, with_control(stage, kp=1.25))
    named, finding = single(found)
    assert named == ("x", "force_actual", "controller_kp")
    assert finding.value == pytest.approx(0.8, rel=0.01)
    assert found.settings.axes[0].control.kp == pytest.approx(stage.axes[0].control.kp, rel=0.01)
    both = audit_channels(recorded, with_control(stage, kd=1.25, ki=2.0))
    assert {f.finding for f in both.findings} == {"controller_kd", "controller_ki"}


def test_a_controller_of_another_kind_shows_in_the_remainder(stage, recorded):
    odd = spoilt(recorded, force_actual=lambda f: f + 2 * np.sin(np.arange(len(f))))
    (finding,) = [f for f in audit_channels(odd, stage).findings if f.finding != "quantisation"]
    assert (finding.finding, finding.unit) == ("controller", "N")
    assert finding.value == pytest.approx(np.sqrt(2), rel=0.05)


@pytest.mark.parametrize(("share", "delay"), [(0.15, None), (0.125, 0.5e-3)])
def test_the_stages_own_current_loop_is_no_fault_of_a_channel(stage, recorded, share, delay):
    slow = with_control(stage, current_bandwidth=share)
    if delay is not None:
        late = replace(slow.axes[0], effects=(library()["dead_time"].at(delay=delay),))
        slow = replace(slow, axes=(late, slow.axes[1]))
    demand = np.column_stack([a.position_demand for a in recorded.axes.values()])
    offset = np.column_stack([a.force_offset for a in recorded.axes.values()])
    response = simulate(slow, demand, offset, 3)
    x = replace(
        recorded.axes["x"],
        position_actual=response.position[:, 0], force_actual=response.force[:, 0],
    )  # fmt: skip
    found = audit_channels(replace(recorded, axes={**recorded.axes, "x": x}), stage)
    assert found.findings == ()
    assert found.current_paths["x"].bandwidth == pytest.approx(1500 * share, rel=0.01)
    assert found.current_paths["x"].dead_time == (
        None if delay is None else pytest.approx(delay, rel=0.01)
    )


@pytest.mark.parametrize("figure", [{"current_bandwidth": 0.16}, {}])
def test_nor_is_it_behind_a_coarse_encoder(stage, figure):
    """Between two samples acceleration is known best, but no force is late for that."""
    whole = read_recording(DATA / "null-2.h5")
    coarse = [replace(a, increment=1e-7, noise=5e-8) for a in stage.axes]
    file = replace(stage, axes=tuple(coarse))
    effects = () if figure else (library()["dead_time"].at(delay=0.5e-3),)
    slow = with_control(file, **figure)
    slow = replace(slow, axes=(replace(slow.axes[0], effects=effects), slow.axes[1]))
    demand = np.column_stack([a.position_demand for a in whole.axes.values()])
    offset = np.column_stack([a.force_offset for a in whole.axes.values()])
    response = simulate(slow, demand, offset, 3)
    axes = {
        name: replace(
            signals, position_actual=response.position[:, a], force_actual=response.force[:, a]
        )
        for a, (name, signals) in enumerate(whole.axes.items())
    }
    assert audit_channels(replace(whole, axes=axes), file).misleading == ()


def test_a_drive_that_runs_into_its_peak_force_is_no_other_controller(stage, recorded):
    """The clamp and the integrator's halt belong to the law: only saturation is reported."""
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
    named, finding = single(audit_channels(made, weak))
    assert named == ("x", "force_actual", "saturation")
    assert finding.value == pytest.approx(np.mean(np.abs(response.force[:, 0]) > 44.7), rel=0.3)


def test_a_force_that_no_stable_controller_makes_corrects_nothing(stage, recorded):
    """A least-squares fit to any force gives gains; they would pass for the drive's."""
    rng = np.random.default_rng(1)
    other = spoilt(recorded, force_actual=lambda f: rng.permutation(f))
    found = audit_channels(other, stage)
    named, finding = single(found)
    assert named == ("x", "force_actual", "controller_unknown")
    assert finding in found.misleading
    assert found.settings == stage


def test_an_offset_that_is_zero_throughout_has_no_factor(stage, recorded):
    silent = spoilt(recorded, force_offset=np.zeros_like)
    for of in (stage, with_control(stage, kd=1.25, ki=2.0), with_control(stage, kp=1.25, ki=0.5)):
        assert "force_offset" not in {f.channel for f in audit_channels(silent, of).findings}


@pytest.mark.parametrize("late", [1, 2])
def test_a_late_log_of_a_stage_with_dead_time(stage, recorded, late):
    demand = np.column_stack([a.position_demand for a in recorded.axes.values()])
    offset = np.column_stack([a.force_offset for a in recorded.axes.values()])
    x = replace(stage.axes[0], effects=(library()["dead_time"].at(delay=0.8e-3),))
    response = simulate(replace(stage, axes=(x, stage.axes[1])), demand, offset, 3)
    force = response.force[:, 0]
    slow = replace(
        recorded.axes["x"],
        position_actual=response.position[:, 0],
        force_actual=np.concatenate((np.repeat(force[:1], late), force[:-late])),
    )
    found = audit_channels(replace(recorded, axes={**recorded.axes, "x": slow}), stage)
    named, finding = single(found)
    assert named == ("x", "force_actual", "delay")
    assert finding.value == pytest.approx(late * 1e-3)
    assert found.current_paths["x"].dead_time == pytest.approx(0.8e-3, rel=0.02)
