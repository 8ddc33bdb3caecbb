"""Known effects along the moves of one axis: predicted, taken from what is measured, carried on."""

import numpy as np
import pytest

from estimation.known_effects import KnownTerms
from estimation.known_effects.terms import Base
from estimation.move import MoveData
from estimation.trajectory import Limits, plan
from stagectl.config import load_machine
from stagectl.sequencer.compensation.known_axis import SAMPLES_BEFORE_MOVE, KnownAxis

TS, TC, AHEAD = 1e-3, 1e-4, 1.56e-4
AXIS = load_machine().axes["y"]
LIMITS = Limits(0.5, 3.0, 200.0)
STILL = plan(0.0, 0.0, LIMITS)


def known(**terms):
    return KnownAxis(KnownTerms(**terms), 0, AXIS, TS)


def positions(motion, rest=20):
    """Of both axes at the SYNCs from two samples of rest on, the second one still."""
    count = SAMPLES_BEFORE_MOVE + int(motion.duration / TS) + 1 + rest
    own = motion.sample((np.arange(count) - SAMPLES_BEFORE_MOVE) * TS)[0]
    return np.column_stack((own, np.zeros(count)))


def record(path, force, rest_force=0.0):
    ok = np.ones(len(path), dtype=bool)
    return MoveData(path[:, 0], np.broadcast_to(force, len(path)), ok, 0.0, rest_force)


def test_a_force_over_position_is_sent_on_the_way_and_taken_back_where_it_was_met():
    axis = known(forces=[lambda x: 100.0 * np.asarray(x)])
    motion = plan(0.01, 0.03, LIMITS)
    axis.plan(motion, STILL, 200, AHEAD)
    friction = axis.friction_at_rest(7.0, 0.01)
    assert friction == pytest.approx(7.0 - 1.0)
    offsets = axis.offsets(friction, np.zeros(200))
    there = motion.sample(np.arange(1, 201) * TS + AHEAD)[0]
    np.testing.assert_allclose(offsets, 100.0 * (there - 0.01), atol=1e-9)
    path = positions(motion)
    bare = axis.without(record(path, 6.0 + 100.0 * path[:, 0], 7.0), path, np.ones(len(path)))
    np.testing.assert_allclose(bare.force, 6.0, atol=1e-9)
    assert bare.rest_force == pytest.approx(6.0)


def test_an_offset_sent_again_from_the_middle_goes_on_without_a_jump():
    axis = known(forces=[lambda x: 100.0 * np.asarray(x)], gain=0.9)
    axis.plan(plan(0.0, 0.02, LIMITS), STILL, 150, AHEAD)
    change = np.linspace(0.0, 5.0, 150)
    whole = axis.offsets(axis.friction_at_rest(2.0, 0.0), change)
    rest = axis.offsets(axis.friction_at_rest(2.0, 0.0) + change[59], change[60:] - change[59], 60)
    np.testing.assert_allclose(whole[59] + rest, whole[60:], atol=1e-9)


def test_hysteresis_is_carried_from_move_to_move_along_measured_positions():
    axis = known(hysteresis=[(1.0, 3000.0)])
    out, back = plan(0.0, 0.01, LIMITS), plan(0.01, 0.0099, LIMITS)
    axis.plan(out, STILL, 100, AHEAD)
    path = positions(out)
    axis.without(record(path, 6.0), path, np.ones(len(path)))
    axis.carry(path)
    assert axis.friction_at_rest(5.0, 0.01) == pytest.approx(4.0)
    axis.plan(back, STILL, 100, AHEAD)
    offsets = axis.offsets(4.0, np.zeros(100))
    assert offsets[-1] == pytest.approx(-0.3)
    axis.forget()
    assert axis.friction_at_rest(5.0, 0.01) == pytest.approx(5.0)


def test_a_base_swings_on_while_the_axis_rests():
    axis, whole = (known(bases=[Base(0.03, 9.0, 0.08)]) for _ in range(2))
    motion = plan(0.0, 0.02, LIMITS)
    count = int(motion.duration / TS) + 2
    axis.plan(motion, STILL, count, AHEAD)
    axis.offsets(0.0, np.zeros(count))
    assert np.abs(axis.hold(40)).max() > 0.2
    whole.plan(motion, STILL, count + 90, AHEAD)
    expected = whole.offsets(0.0, np.zeros(count + 90))
    first = axis.hold(40)
    axis.held(25)  # the hold ended early
    second = axis.hold(60)
    found = expected[count - 1] + np.concatenate((first[:25], first[24] + second))
    np.testing.assert_allclose(found, expected[count : count + 85], atol=1e-9)
    # Measured positions tell the same.
    path = positions(motion, rest=40)
    axis.carry(path)
    axis.plan(plan(0.02, 0.02, LIMITS), STILL, 20, AHEAD)
    later = axis.offsets(0.0, np.zeros(20))
    # Sample k of the path is at time k - 2 of the demand, time 0 of the next one Tc before a SYNC.
    begin = len(path) - SAMPLES_BEFORE_MOVE - TC / TS
    due = np.interp(begin + np.arange(21), np.arange(1, len(expected) + 1), expected)
    np.testing.assert_allclose(later, due[1:] - due[0], atol=2e-3)


def test_a_record_overlaps_the_one_before():
    """Its first samples end that one: the base must not swing through them twice."""
    split, whole = (known(bases=[Base(0.03, 9.0, 0.08)]) for _ in range(2))
    path = positions(plan(0.0, 0.02, LIMITS), rest=60)
    whole.carry(path)
    half = len(path) - 30  # at rest
    split.carry(path[:half])
    split.carry(path[half - SAMPLES_BEFORE_MOVE :])
    assert split.friction_at_rest(0.0, 0.02) == pytest.approx(
        whole.friction_at_rest(0.0, 0.02), abs=1e-4
    )


def test_saturated_samples_and_unseen_accelerations_say_nothing_of_friction():
    axis = known(coupled_mass=0.4, gain=0.8)
    path = positions(plan(0.0, 0.02, LIMITS))
    force = np.full(len(path), 5.0)
    force[30] = AXIS.drive.peak_force + 1.0
    seen = np.ones(len(path), dtype=bool)
    seen[60] = False
    bare = axis.without(record(path, force), path, seen)
    assert list(np.flatnonzero(bare.disturbed)) == [30, 59, 60, 61]
    assert bare.valid.all()


def test_the_acceleration_of_the_other_axis_is_met():
    axis = known(coupled_mass=0.4)
    motion = plan(0.0, 0.02, LIMITS)
    axis.plan(STILL, motion, 150, AHEAD)
    offsets = axis.offsets(0.0, np.zeros(150))
    expected = 0.4 * motion.sample(np.arange(1, 151) * TS + AHEAD)[2]
    np.testing.assert_allclose(offsets, expected, atol=1e-9)


def test_the_coulomb_force_is_relative_to_where_the_move_ends():
    axis = known(table_factors=[lambda x, _: 1.0 + 10.0 * x], forward=1.1, backward=0.9)
    path = positions(plan(0.02, 0.0, LIMITS))
    assert axis.meet_coulomb(path, 0.0) == axis.local == pytest.approx(1.0)
    variation = axis.variation(None, path, np.zeros(len(path)))
    assert (variation[0], variation[-1]) == pytest.approx((0.2, -0.1))  # 0: not yet in motion
    both = axis.variation(np.full(len(path), 0.5), path, np.zeros(len(path)))
    assert both[-1] == pytest.approx(0.9 * 1.5 - 1.0)


def test_along_a_short_move_the_coulomb_force_is_the_same():
    axis = known(table_factors=[lambda x, _: 1.0 + 10.0 * x])
    path = positions(plan(0.02, 0.02005, LIMITS))
    assert axis.meet_coulomb(path, 0.0) == pytest.approx(1.2005)
    assert not axis.varies
    assert axis.variation(None, path, np.zeros(len(path))) is None
