"""Process noise out of histories whose truth is known."""

import numpy as np
import pytest

from estimation.field.process_noise import DAY, Series, learn


def histories(rate, scatter, places=15, weeks=30, seed=1):
    generator = np.random.default_rng(seed)
    time = np.arange(weeks) * 7 * DAY
    walks = np.cumsum(generator.normal(0, rate * np.sqrt(7.0), (places, weeks)), axis=1)
    values = walks + generator.normal(0, np.hypot(scatter, 0.002), (places, weeks))
    return [Series(time, value, np.full(weeks, 0.002)) for value in values]


@pytest.mark.parametrize(("rate", "scatter"), [(0.003, 0.01), (0.01, 0.02)])
def test_rate_and_scatter_are_found(rate, scatter):
    found = learn(histories(rate, scatter))
    assert found.rate == pytest.approx(rate, rel=0.35)
    assert found.scatter == pytest.approx(scatter, rel=0.5)
    assert found.steps == 15 * 29


def test_a_table_that_does_not_change_has_a_small_rate_and_no_history_the_usual_one():
    assert learn(histories(0.0, 0.01)).rate < 0.0015
    nothing = learn([Series(np.zeros(1), np.zeros(1), np.ones(1))])
    assert (nothing.rate, nothing.scatter, nothing.steps) == (
        pytest.approx(0.01), pytest.approx(0.01), 0
    )  # fmt: skip
