"""The drive's profile generator against the limits it is given and closed forms."""

import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil_sim.cia402.profile_generator import ProfileGenerator, trapezoid

positions = st.floats(-0.1, 0.1)
rates = st.floats(0.1, 20.0)


@given(positions, st.floats(-0.5, 0.5), positions, st.floats(1e-3, 1.0), rates, rates)
def test_ends_at_rest_at_the_target_within_the_limits(p, v, target, speed, up, down):
    segments = trapezoid(p, v, target, speed, up, down)
    for a, b in itertools.pairwise(segments):
        end = a.at(a.duration)
        assert end == pytest.approx((b.position, b.velocity), abs=1e-9)
    highest = max(speed, abs(v))
    for s in segments:
        assert abs(s.velocity) <= highest * (1 + 1e-9)
        assert abs(s.acceleration) <= max(up, down) * (1 + 1e-9)
    if segments:
        x, rest = segments[-1].at(segments[-1].duration)
        assert x == pytest.approx(target, abs=1e-9)
        assert rest == pytest.approx(0.0, abs=1e-7)
    else:
        assert p == pytest.approx(target, abs=1e-12)


def test_long_move_takes_distance_over_speed_plus_the_ramps():
    segments = trapezoid(0.0, 0.0, 0.1, 0.5, 5.0, 2.5)
    assert sum(s.duration for s in segments) == pytest.approx(0.1 / 0.5 + 0.05 + 0.1)


def test_short_move_is_a_triangle():
    segments = trapezoid(0.0, 0.0, -0.01, 10.0, 1.0, 1.0)
    assert sum(s.duration for s in segments) == pytest.approx(2 * math.sqrt(0.01))


def test_generator_rests_exactly_at_the_target():
    generator = ProfileGenerator(1e-3)
    generator.take_over(0.012, 0.0)
    generator.move(0.0200003, 0.1, 1.0, 1.0, jerk=50.0)
    steps = 0
    while not generator.done:
        generator.step()
        steps += 1
        assert steps < 1000
    assert generator.position == 0.0200003


@given(st.floats(-0.5, 0.5), rates)
def test_stop_takes_the_braking_distance(v, rate):
    generator = ProfileGenerator(1e-3)
    generator.take_over(0.0, v)
    generator.stop(rate)
    for _ in range(round(abs(v) / rate * 1000) + 2):
        generator.step()
    assert generator.done
    assert generator.position == pytest.approx(v * abs(v) / (2 * rate), abs=1e-12)


def test_absurdly_small_jerk_is_smoothed_over_a_second_at_most():
    generator = ProfileGenerator(1e-3)
    generator.move(1e-3, 1.0, 4000.0, 4000.0, jerk=1e-6)
    for _ in range(1100):
        generator.step()
    assert generator.done
