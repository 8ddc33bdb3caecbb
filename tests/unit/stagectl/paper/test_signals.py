"""Alignment, filter and zones."""

import numpy as np
import pytest

from stagectl.paper import Case
from stagectl.paper.signals import prepare


def test_alignment_takes_the_mean_of_two_commands():
    logged, aligned = (prepare(Case(cut_off=None, force=f)) for f in ("logged", "aligned"))
    np.testing.assert_allclose(aligned.force[1:], 0.5 * (logged.force[1:] + logged.force[:-1]))


def test_zone_a_begins_where_all_elements_slip_and_ends_at_the_turn(move):
    assert move.position[move.slide] == pytest.approx(3.77e-3, abs=0.02e-3)
    assert (move.velocity[move.slide : move.turn] > 0).all()
    assert move.velocity[move.turn] <= 0
    assert move.end - move.turn == 1000


def test_borders_move_as_asked(move):
    moved = prepare(Case(onset=6e-3, shift=-2e-3, stick=10e-3))
    assert moved.position[moved.slide] == pytest.approx(6e-3, abs=0.02e-3)
    assert moved.turn == move.turn - 40
    assert moved.end == moved.turn + 200


@pytest.mark.parametrize(
    ("borders", "said"),
    [({"onset": 1.0}, "no zone A"), ({"stick": 5.0}, "leave the record"),
     ({"shift": -1.0}, "leave the record")],
)  # fmt: skip
def test_impossible_zones_are_said(borders, said):
    with pytest.raises(ValueError, match=said):
        prepare(Case(**borders))


def test_filter_has_no_lag_and_leaves_the_force_on_request():
    raw = prepare(Case(cut_off=None))
    force_too = prepare(Case(cut_off=50.0))
    not_force = prepare(Case(cut_off=50.0, filter_force=False))
    np.testing.assert_array_equal(not_force.force, raw.force)
    assert not np.array_equal(force_too.force, raw.force)
    peak = int(np.argmax(raw.velocity))
    assert abs(int(np.argmax(force_too.velocity)) - peak) < 4
