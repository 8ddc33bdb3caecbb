"""The compiled filter: the one of `ObserverModel` where samples are punctual."""

from __future__ import annotations

import numpy as np
import pytest

from estimation.observer.filter import predict, take_in
from estimation.observer.model import LACK, make_model
from tests.unit.estimation.observer.axes import CARRIAGE, DRIVE, PERIOD

WALK, NOISE = 0.3, 2e-9
MODEL = make_model(DRIVE, CARRIAGE, PERIOD, WALK, NOISE)
VECTORS = np.array([MODEL.ramp_from, MODEL.ramp_to, MODEL.kick])


def run(periods, covariance, variance):
    """Samples of so much more variance [m^2]; returns what the last one changed, per m."""
    states = len(MODEL.gain)
    rooms, gain = np.zeros((states + 1, states)), np.zeros(states)
    for _ in range(periods):
        gain = np.zeros(states)
        take_in(gain, covariance, 1.0, NOISE**2 + variance)
        estimate = np.zeros(states)
        predict(MODEL.transition, VECTORS, (0.0, 0.0), variance, estimate, covariance, rooms)
        covariance[LACK, LACK] += WALK**2
    return gain


def test_it_begins_and_stays_steady():
    covariance = MODEL.covariance.copy()
    assert run(20_000, covariance, 0.0) == pytest.approx(MODEL.gain, rel=1e-3)
    assert covariance == pytest.approx(MODEL.covariance, rel=1e-3)


def test_it_comes_back_to_it():
    covariance = MODEL.covariance.copy()
    loose = run(200, covariance, (5e-6) ** 2)
    assert abs(loose[LACK]) < 0.02 * abs(MODEL.gain[LACK])
    assert np.linalg.eigvalsh(covariance / np.sqrt(np.outer(*[np.diag(covariance)] * 2))).min() > 0
    assert run(100, covariance, 0.0) == pytest.approx(MODEL.gain, rel=1e-3)
