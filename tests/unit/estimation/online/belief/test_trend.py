"""Surprises that go one way are a trend, and it continues between moves; wander is none."""

import math

import numpy as np
import pytest

from estimation.online.belief.belief import BeliefSettings
from estimation.online.belief.trend import LASTING, RATE, Trend

WANDER, CORRELATION = 0.01, 0.5
SETTINGS = BeliefSettings(wander=WANDER, correlation_time=CORRELATION)
SIGMA = 0.005
BELIEVED = (6.0, 0.5**2)
APART = 0.25


def followed(trend, base, moves, seed, start=0.0, apart=APART):
    """Let a trend see moves of a stage with wander; what it knew after each."""
    generator = np.random.default_rng(seed)
    keep = math.exp(-apart / CORRELATION)
    wander, known = generator.normal(0.0, WANDER), []
    for number in range(1, moves + 1):
        time = start + number * apart
        wander = keep * wander + math.sqrt(1.0 - keep**2) * generator.normal(0.0, WANDER)
        value = base(time) * (1.0 + wander) * (1.0 + generator.normal(0.0, SIGMA))
        trend.saw(time, value, SIGMA**2, BELIEVED)
        known.append((time, *trend.carry(time, time + 1.5), trend.probability))
    return np.array(known)


@pytest.mark.parametrize("seed", range(3))
def test_a_quiet_stage_is_hardly_carried_on_nor_doubted(seed):
    known = followed(Trend(SETTINGS), lambda _: 6.0, 300, seed)
    _, change, variance, probability = known[40:].T
    assert np.sqrt(np.mean(change**2)) < 0.5 * WANDER  # over 1.5 s of rest
    assert np.mean(variance) < 1.5 * WANDER**2
    assert np.median(probability) < 0.2


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize("time_constant", [4.0, 5.0, 8.0])
def test_a_stage_that_warms_up_is_carried_on_over_a_rest(sign, time_constant):
    def base(time):
        return 6.0 * (1.0 + 0.25 * sign * math.exp(-time / time_constant))

    missed, still = [], []
    for seed in range(12):
        known = followed(Trend(SETTINGS), base, 20, seed)
        time, change = known[8:, 0], known[8:, 1]
        real = np.array([math.log(base(t + 1.5) / base(t)) for t in time])
        missed.append(change - real)
        still.append(real)
    assert np.sqrt(np.mean(np.square(missed))) < 0.6 * np.sqrt(np.mean(np.square(still)))
    assert abs(np.mean(missed)) < 0.5 * abs(np.mean(still))


def test_what_it_leaves_open_is_about_what_it_misses():
    """Drifts as the hypothesis has them: what it misses is as large as it says, to chance."""
    generator = np.random.default_rng(9)
    chi = []
    for seed in range(60):
        rate, keep = generator.normal(0.0, RATE), math.exp(-1e-3 / LASTING)
        course = [math.log(6.0)]
        for _ in range(5000):
            rate = keep * rate + math.sqrt(1.0 - keep**2) * generator.normal(0.0, RATE)
            course.append(course[-1] + 1e-3 * rate)
        log = np.array(course)
        known = followed(
            Trend(SETTINGS), lambda t, log=log: math.exp(log[round(t / 1e-3)]), 13, seed
        )
        time, change, variance, _ = known[-1]
        begin = round(time / 1e-3)
        chi.append((log[begin + 1500] - log[begin] - change) ** 2 / variance)
    assert 0.4 < np.mean(chi) < 1.5


def test_a_step_is_not_carried_on_as_a_rate():
    trend = Trend(SETTINGS)
    known = followed(trend, lambda t: 6.0 if t < 10.0 else 6.6, 44, 2)
    after = np.abs(known[:, 1])[known[:, 0] >= 10.0]
    assert after.max() < 0.03
    assert after[-1] < 0.02


def test_what_it_knew_is_forgotten_where_it_is_told_to():
    trend = Trend(SETTINGS)
    followed(trend, lambda t: 6.0 + math.exp(-t / 5.0), 12, 1)
    time = 12 * APART
    assert trend.carry(time, time + 1.0)[0] < -0.01
    assert trend.carry(time, time) == (0.0, 0.0)
    trend.calm()
    assert trend.carry(time, time + 1.0) == (0.0, 0.0)


def test_the_rate_is_that_of_a_kalman_filter():
    """One value after another, against the filter in matrices."""
    trend = Trend(SETTINGS)
    generator = np.random.default_rng(4)
    mean = np.array([0.0, math.log(BELIEVED[0]), 0.0])
    spread = np.diag([WANDER**2, BELIEVED[1], RATE**2])
    row, apart, lasting = np.array([1.0, 1.0, 0.0]), 0.3, LASTING
    keep, hold = math.exp(-apart / CORRELATION), math.exp(-apart / lasting)
    step = np.array([[keep, 0, 0], [0, 1, lasting * (1 - hold)], [0, 0, hold]])
    # Noise of the integrated rate by quadrature: r's own at s, kept until the end.
    s = (np.arange(20000) + 0.5) / 20000 * apart
    reach = np.stack([lasting * (1.0 - np.exp(-s / lasting)), np.exp(-s / lasting)])
    gained = 2.0 * RATE**2 / lasting * (reach @ reach.T) * apart / 20000
    noise = np.zeros((3, 3))
    noise[1:, 1:] = gained
    noise[0, 0] = (1.0 - keep**2) * WANDER**2
    noise[1, 1] += SETTINGS.drift[0] ** 2
    for number in range(1, 8):
        value = math.log(6.0) + generator.normal(0.0, 0.01)
        trend.saw(number * apart, math.exp(value), SIGMA**2, BELIEVED)
        if number > 1:
            mean, spread = step @ mean, step @ spread @ step.T + noise
        else:
            spread[1, 1] += SETTINGS.drift[0] ** 2
        gain = spread @ row / (row @ spread @ row + SIGMA**2 + 0.004**2)
        mean = mean + gain * (value - row @ mean)
        spread = spread - np.outer(gain, row @ spread)
    rate, sigma = trend.rate
    assert rate == pytest.approx(mean[2], rel=1e-6)
    assert sigma == pytest.approx(math.sqrt(spread[2, 2]), rel=1e-6)


def test_a_vague_move_that_is_astray_is_no_step():
    trend = Trend(SETTINGS)
    time = followed(trend, lambda _: 6.0, 12, 5)[-1, 0]
    before = trend.carry(time, time + 0.3)
    trend.saw(time + 0.2, 7.2, 0.012**2, BELIEVED)
    change, variance = trend.carry(time + 0.2, time + 0.5)
    assert abs(change - before[0]) < 0.01
    assert variance < 0.03**2


def test_the_odds_of_a_drift_return_to_even_within_half_a_minute():
    trend = Trend(SETTINGS)
    known = followed(trend, lambda time: 6.0 * math.exp(0.03 * time), 20, 1)

    def odds():
        return math.log(trend.probability / (1.0 - trend.probability))

    before = odds()
    assert before > 1.0
    trend.saw(known[-1, 0] + 30.0, 6.0, 1e9, BELIEVED)  # a move that says nothing
    assert odds() == pytest.approx(before * math.exp(-1.0), rel=0.02)
