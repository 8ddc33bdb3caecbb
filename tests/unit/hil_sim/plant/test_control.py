"""The cascade in place of the PID: against the difference equations written out."""

from dataclasses import replace

import numpy as np
import pytest

from hil_sim.plant import simulate
from hil_sim.settings import CascadeSettings
from sim2real.audit.controller_law import reconstruct_law
from sim2real.gap import prepare_replay
from stagectl.config import load_machine, stage_settings
from stagedata import AxisSignals, Recording

KP, KV, KI = 60.0, 2500.0, 30_000.0


def stage(span=2, integral=0.0, feedforward=0.0, tick=1e-4):
    whole = stage_settings(load_machine())
    x = whole.axes[0]
    control = replace(
        x.control, kp=KP * KV, ki=KP * integral, kd=KV, derivative_time=0.0, period=tick,
        cascade=CascadeSettings(KP, KV, integral, feedforward, span),
    )  # fmt: skip
    return replace(whole, axes=(replace(x, control=control, noise=0.0),))


def moved(settings, seed=None):
    t = np.clip((np.arange(900) - 50) / 500, 0, 1)
    demand = np.round(1e7 * t**3 * (10 - 15 * t + 6 * t**2))[:, None] * 1e-9
    offset = np.zeros_like(demand)
    response = simulate(settings, demand, offset, seed)
    axis = AxisSignals(
        demand[:, 0], offset[:, 0], response.position[:, 0], response.force[:, 0], None,
        np.ones(len(demand), dtype=bool),
    )  # fmt: skip
    return Recording("", "", "", np.arange(len(demand)) * 1e-3, {"x": axis}, (), "here")


def test_one_tick_per_sync_is_the_published_law():
    """The velocity loop gets kp kv (qg - qm) - kv dqm, dqm of the mean of two positions (EMPS)."""
    settings = stage(tick=1e-3)
    x = moved(settings).axes["x"]
    q, r = x.position_actual, x.position_demand
    mean = (q + np.concatenate((q[:1], q[:-1]))) / 2
    rate = np.diff(mean, prepend=mean[:1]) / 1e-3
    force = KV * (KP * (r - q) - rate)
    # The sample at SYNC k is taken before the tick there: it shows the tick before.
    left = x.force_actual[10:] - force[9:-1]
    assert np.abs(left).max() < 0.6 * 0.04 + 0.01 * np.abs(force).max()


@pytest.mark.parametrize("span", [1, 2])
@pytest.mark.parametrize(("integral", "feedforward"), [(0.0, 0.0), (KI, 0.0), (KI, 1.0)])
def test_the_law_recomputed_from_the_log_is_the_cascade(span, integral, feedforward):
    settings = stage(span, integral, feedforward)
    recorded = moved(settings)
    law = reconstruct_law(prepare_replay(recorded, settings), settings, "x")
    left = (law.force - law.terms().sum(axis=0))[law.usable]
    assert np.std(left) < 1.2 * 0.04 / np.sqrt(12)


def test_the_loop_follows_and_the_integral_leaves_nothing():
    lazy, keen = (moved(stage(integral=i)).axes["x"] for i in (0.0, KI))
    assert abs(lazy.position_demand[-1] - lazy.position_actual[-1]) > 1e-6
    assert abs(keen.position_demand[-1] - keen.position_actual[-1]) < 1e-6


def test_a_machine_file_has_one_of_pid_and_cascade():
    from stagectl.config.machine.file import parse_machine
    from stagectl.errors import ConfigError

    text = load_machine().text
    pid = "pid: {kp: 341000.0, ki: 16070000.0, kd: 2714.0, derivative_time: 8.842e-4}"
    cascade = "cascade: {position_gain: 60.0, velocity_gain: 2500.0, span: 2}"
    made = stage_settings(parse_machine(text.replace(pid, cascade), "m"))
    assert made.axes[0].control.cascade == CascadeSettings(60.0, 2500.0, span=2)
    assert made.axes[0].control.kp == 150_000.0
    for wrong in ("", pid + "\n      " + cascade):
        with pytest.raises(ConfigError, match="pid"):
            parse_machine(text.replace(pid, wrong), "m")
