"""Rows that a log lost and values that it repeated: found, left out, and blamed on nothing else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sim2real.audit import audit_channels, repair_samples
from stagectl.store import read_recording
from tests.unit.sim2real.audit.conftest import first
from tests.unit.sim2real.conftest import DATA

CHANNELS = ("position_demand", "force_offset", "position_actual", "force_actual", "valid")


def taken(recorded, rows, channels=CHANNELS, **more):
    """The recording with other rows in these channels, at the times of all its rows."""
    axes = {
        name: replace(s, statusword=None, **{c: getattr(s, c)[rows] for c in channels})
        for name, s in recorded.axes.items()
    }
    return replace(recorded, axes=axes, **more)


@pytest.fixture(scope="module")
def sound():
    return first(read_recording(DATA / "null-2.h5"), 4000)


@pytest.fixture(scope="module")
def kept(sound):
    """Rows that are left where one in a hundred is lost."""
    rng = np.random.default_rng(3)
    return np.sort(rng.choice(len(sound), round(0.99 * len(sound)), replace=False))


def kinds(findings):
    return {(f.axis, f.channel, f.finding) for f in findings}


@pytest.mark.parametrize("name", ["null-1.h5", "null-2.h5", "null-3.h5", "null-1-other-moves.h5"])
def test_sound_recordings_stay_as_they_are(stage, name):
    recorded = read_recording(DATA / name)
    assert repair_samples(recorded, stage) == (recorded, [])


def test_noise_that_the_machine_file_does_not_state_holds_nothing(stage, sound):
    """Rounded noise repeats values now and then, and what follows looks like catching up."""
    rng = np.random.default_rng(1)
    axes = {}
    for name, signals in sound.axes.items():
        noisy = signals.position_actual + 2e-5 * rng.standard_normal(len(sound))
        axes[name] = replace(signals, position_actual=np.round(noisy, 6))
    noisy = replace(sound, axes=axes)
    assert repair_samples(noisy, stage) == (noisy, [])


def test_a_rest_between_two_strokes_the_same_way_is_not_held(stage, sound):
    """It starts a little faster than it stopped: not by all that it would have missed."""
    steps = 3e-6 + 1e-6 * np.sin(np.arange(len(sound)) / 300.0)
    steps[1000:1500], steps[1500:1502] = 0.0, 5e-6
    x = replace(sound.axes["x"], position_actual=np.cumsum(steps))
    rested = replace(sound, axes={**sound.axes, "x": x})
    assert repair_samples(rested, stage)[1] == []


def test_lost_rows_are_put_back_and_not_valid(stage, sound, kept):
    gaps = taken(sound, kept, time=sound.time[kept], moves=())
    repaired, findings = repair_samples(gaps, stage)
    assert kinds(findings) == {("all", "time", "missing")}
    assert audit_channels(repaired, stage).findings == ()
    x = repaired.axes["x"]
    lost = np.setdiff1d(np.arange(len(sound)), kept)
    demand = sound.axes["x"].position_demand
    moving = [k for k in lost[lost > 0] if abs(demand[k + 1] - demand[k - 1]) > 1e-6]
    assert len(moving) > 5
    for k in moving:
        (row,) = np.flatnonzero(np.abs(repaired.time - sound.time[k]) < 0.2e-3)
        assert not x.valid[row]
        assert x.position_demand[row] == pytest.approx(demand[k], abs=1e-7)


def test_moves_keep_their_samples(stage, sound, kept):
    index = np.searchsorted(kept, [e for m in sound.moves for e in (m.start, m.end)])
    moves = tuple(
        replace(m, start=int(index[2 * i]), end=int(index[2 * i + 1]))
        for i, m in enumerate(sound.moves)
    )
    gaps = taken(sound, kept, time=sound.time[kept], moves=moves)
    repaired, _ = repair_samples(gaps, stage)
    for before, after in zip(gaps.moves, repaired.moves, strict=True):
        assert repaired.time[after.start] == pytest.approx(gaps.time[before.start])
        assert repaired.time[after.end - 1] == pytest.approx(gaps.time[before.end - 1], abs=1.1e-3)


@pytest.mark.parametrize(
    "channels", [CHANNELS, ("position_actual", "force_actual"), ("position_actual",)]
)
def test_held_values_are_not_valid(stage, sound, kept, channels):
    rows = np.zeros(len(sound), dtype=int)
    rows[kept] = kept
    held, findings = repair_samples(taken(sound, np.maximum.accumulate(rows), channels), stage)
    assert kinds(findings) == {(a, "position_actual", "held") for a in "xy"}
    assert audit_channels(held, stage).findings == ()


@pytest.fixture(scope="module")
def neighbours(sound):
    """Rows at full speed that are lost or held with one good row between them."""
    speed = np.abs(np.diff(sound.axes["x"].position_demand))
    fastest = int(np.argmax(speed))
    return np.array([fastest - 2, fastest, fastest + 2])


def test_next_to_a_lost_row_may_be_another_one(stage, sound, neighbours):
    kept = np.setdiff1d(np.arange(len(sound)), neighbours)
    repaired, _ = repair_samples(taken(sound, kept, time=sound.time[kept], moves=()), stage)
    assert len(repaired) == len(sound)
    assert not repaired.axes["x"].valid[neighbours].any()
    demand = repaired.axes["x"].position_demand - sound.axes["x"].position_demand
    assert np.abs(demand).max() < 1e-7


def test_next_to_a_held_value_may_be_another_one(stage, sound, neighbours):
    rows = np.arange(len(sound))
    rows[neighbours] -= 1
    held, _ = repair_samples(taken(sound, rows, ("position_actual", "force_actual")), stage)
    assert np.flatnonzero(~held.axes["x"].valid).tolist() == neighbours.tolist()


def test_a_value_behind_a_late_one_may_be_late_too(stage, sound, neighbours):
    """Two samples each hold what belongs to the one before."""
    rows = np.arange(len(sound))
    late = neighbours[0] + np.arange(2)
    rows[late] -= 1
    held, _ = repair_samples(taken(sound, rows, ("position_actual", "force_actual")), stage)
    assert np.flatnonzero(~held.axes["x"].valid).tolist() == late.tolist()


def test_where_the_demand_does_not_say_a_gap_is_what_the_others_are(stage, sound, neighbours):
    """At rest, and where a move begins."""
    x = sound.axes["x"].position_demand
    begins = int(np.flatnonzero(np.diff(x) != 0.0)[0]) + 2
    still = begins - 10
    gone = np.array([still, begins, *neighbours])
    kept = np.setdiff1d(np.arange(len(sound)), gone)
    repaired, _ = repair_samples(taken(sound, kept, time=sound.time[kept], moves=()), stage)
    assert np.flatnonzero(~repaired.axes["x"].valid).tolist() == gone.tolist()


def test_where_the_host_paused_nothing_is_put_back(stage, sound):
    """The drives held their setpoint for ten periods; the demand continued where it was."""
    later = np.where(np.arange(len(sound)) < 1000, 0.0, 0.01)
    paused = replace(sound, time=sound.time + later)
    assert repair_samples(paused, stage) == (paused, [])
