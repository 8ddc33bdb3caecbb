"""The simulated move: gains, profile, friction and the instants of the samples."""

import numpy as np
import pytest

from stagectl.paper import Case, published
from stagectl.paper.simulate import demand, duration, gains, prepare, simulate


@pytest.mark.parametrize("bandwidth", [20.0, 100.0, 300.0])
def test_gains_put_the_closed_loop_at_the_bandwidth(bandwidth):
    kp, ki, kd = gains(bandwidth)

    def closed(frequency):
        s = 2j * np.pi * frequency
        return abs((kd * s**2 + kp * s + ki) / (published.MASS * s**3 + kd * s**2 + kp * s + ki))

    assert closed(bandwidth) == pytest.approx(np.sqrt(0.5))
    assert closed(1.05 * bandwidth) < closed(bandwidth) < closed(0.95 * bandwidth)


@pytest.mark.parametrize("profile", ["sine", "jerk-limited"])
def test_demand_keeps_the_papers_limits_and_is_consistent(profile):
    end = duration(profile)
    time = np.linspace(-0.01, end + 0.01, 20_001)
    position, acceleration = demand(profile, time)
    assert position[0] == 0.0
    assert position[-1] == pytest.approx(published.DISTANCE, rel=1e-9)
    assert np.abs(acceleration).max() == pytest.approx(published.ACCELERATION, rel=1e-3)
    assert np.gradient(position, time).max() < published.VELOCITY
    step = time[1] - time[0]
    np.testing.assert_allclose(np.diff(position, 2) / step**2, acceleration[1:-1], atol=0.02)


def test_force_of_a_sliding_stage_is_inertia_coulomb_and_viscous():
    record = simulate(Case())
    x, u, period = record.position, record.force, 1 / record.rate
    velocity = (x[2:] - x[:-2]) / (2 * period)
    acceleration = (x[2:] - 2 * x[1:-1] + x[:-2]) / period**2
    # Mean of the forces held before and after a sample belongs to its instant.
    friction = 0.5 * (u[:-2] + u[1:-1]) - published.MASS * acceleration
    fast = record.slipping[1:-1] & (velocity > 0.02)
    assert fast.sum() > 2000
    fast[np.argmax(fast)] = False  # its neighbour before still sticks
    expected = published.REFERENCE["coulomb"] + published.REFERENCE["viscous"] * velocity
    np.testing.assert_allclose(friction[fast], expected[fast], atol=2e-5)


def test_encoder_noise_is_seeded():
    a, b, c = (simulate(Case(noise=1e-9, seed=seed)) for seed in (1, 1, 2))
    np.testing.assert_array_equal(a.force, b.force)
    assert not np.array_equal(a.force, c.force)


@pytest.mark.parametrize(
    ("wrong", "named"),
    [({"rate": 3}, "rate"), ({"rate": 30_000}, "rate"), ({"bandwidth": 0.0}, "bandwidth"),
     ({"bandwidth": 1e4}, "bandwidth"), ({"noise": -1.0}, "noise"), ({"cut_off": 0.0}, "cut_off")],
)  # fmt: skip
def test_impossible_case_is_named(wrong, named):
    with pytest.raises(ValueError, match=named):
        Case(**wrong)


def test_unstable_loop_is_said():
    with pytest.raises(ValueError, match="unstable"):
        simulate(Case(rate=1000, bandwidth=300.0))


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
