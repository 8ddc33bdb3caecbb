"""Where a gap lies: what is put somewhere is found there."""

from dataclasses import replace

import numpy as np
import pytest

from sim2real.gap import compare_with_model, locate_gap
from sim2real.phases import ONSET, split_phases


@pytest.fixture(scope="module")
def sound(stage, recorded):
    """A recording without a gap: its residual is one draw of the floor."""
    measured = compare_with_model(recorded, stage, draws=2)
    return replace(measured, residual=measured.floor.draws[0])


def with_force(sound, put, axis="x", signal="force"):
    """The force (or position) residual of one axis with something put on it."""
    signals = sound.replay.recording.axes[axis]
    phases = split_phases(signals.position_demand, 1e-3)
    added = put(signals.position_demand, phases, np.arange(len(signals)) * 1e-3)
    changed = {**sound.residual[axis], signal: sound.residual[axis][signal] + added}
    return replace(sound, residual={**sound.residual, axis: changed})


def cell(sound, by, put, **where):
    located = locate_gap([with_force(sound, put, **where)])
    top = located.cells[0]
    assert (top.axis, top.by) == (where.get("axis", "x"), "axis")
    assert top.share > 0.8
    return next(c for c in located.cells if c.by == by and c.axis == top.axis)


def test_a_bump_over_the_position(sound):
    found = cell(sound, "position", lambda x, p, t: 3 * np.exp(-(((x - 0.01) / 0.004) ** 2) / 2))
    assert found.range[0] < 0.008
    assert 0.012 < found.range[1] < 0.03
    assert found.share > 0.5
    assert found.unit == "m"


def test_a_wave_over_the_position(sound):
    found = locate_gap([with_force(sound, lambda x, p, t: np.sin(2 * np.pi * x / 0.032))])
    (wave,) = [c for c in found.cells if c.unit == "1/m"]
    assert wave.range[0] < 1 / 0.032 < wave.range[1]


def test_a_vibration(sound):
    found = cell(sound, "frequency", lambda x, p, t: np.sin(2 * np.pi * 40 * t), axis="y")
    assert found.range[0] < 40 < found.range[1] < 80
    assert found.share > 0.8


def test_something_that_fades(sound):
    found = cell(sound, "time", lambda x, p, t: np.exp(-t / 0.8))
    assert found.range[0] == 0
    assert found.range[1] < 2.5


def test_one_direction_only(sound):
    found = cell(sound, "direction", lambda x, p, t: 1.0 * (p.direction < 0))
    assert (found.value, found.share) == (-1, pytest.approx(1, abs=0.1))


def test_one_phase_only(sound):
    found = cell(sound, "phase", lambda x, p, t: 2.0 * (p.phase == ONSET))
    assert found.value == "onset"


def test_one_move_only(sound):
    def put(x, p, t):
        move = sound.replay.recording.moves[6]
        return 3.0 * ((t >= move.start * 1e-3) & (t < move.end * 1e-3))

    assert cell(sound, "move", put).value == 6


def test_high_speed(sound):
    found = cell(sound, "velocity", lambda x, p, t: 30 * p.velocity * (p.velocity > 0.2))
    assert found.range[0] > 0.15


def test_shares_are_of_all_axes_and_signals(sound):
    located = locate_gap([with_force(sound, lambda x, p, t: 1.0, signal="force")])
    total = sum(share for signals in located.excess.values() for share in signals.values())
    assert total == pytest.approx(1, abs=0.05)
    assert list(located.cells) == sorted(located.cells, key=lambda c: -c.share)
    assert all(0 <= c.share <= 1 and c.text for c in located.cells)


def test_several_recordings_are_one_gap(sound):
    two = [with_force(sound, lambda x, p, t: 2.0 * (p.phase == ONSET)), sound]
    (found,) = [c for c in locate_gap(two).cells if c.by == "phase" and c.axis == "x"]
    assert found.value == "onset"
