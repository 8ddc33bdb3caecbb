"""The frequency response: known systems are found, and what is not excited is said to be."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from sim2real.residuals.response import estimate_response

PERIOD = 1e-3


@pytest.fixture
def chirp(course):
    """A course along a chirp of 2 to 100 Hz, followed by a loop of the first order."""
    t = PERIOD * np.arange(16000)
    demand = 50e-6 * np.sin(2 * np.pi * (2.0 * t + 98.0 / 32.0 * t**2))
    share = 1.0 - np.exp(-2 * np.pi * 40.0 * PERIOD)
    position = lfilter([share], [1.0, share - 1.0], demand)
    noise = 1e-9 * np.random.default_rng(1).standard_normal(len(t))
    return replace(
        course, demand=demand, position=demand, valid=np.ones(len(t), dtype=bool),
        measured={"position": position + noise, "force": 0.0 * t},
        simulated={"before": {"position": demand, "force": 0.0 * t}},
    )  # fmt: skip


def exact(frequency):
    share = 1.0 - np.exp(-2 * np.pi * 40.0 * PERIOD)
    return share / (1.0 + (share - 1.0) * np.exp(-2j * np.pi * frequency * PERIOD))


def test_a_loop_of_known_response(chirp):
    found = estimate_response(chirp)
    inside = (found.frequency > 4.0) & (found.frequency < 90.0)
    assert found.excited[inside].all()
    measured = found.response["measured"][inside]
    assert np.abs(measured / exact(found.frequency[inside]) - 1.0).max() < 0.05
    assert np.abs(found.response["before"][inside] - 1.0).max() < 1e-9


def test_what_the_simulation_shares_does_not_hide_the_difference(chirp):
    """A gain that changes from second to second lowers the coherence, measured and simulated."""
    t = PERIOD * np.arange(len(chirp.position))
    gain = 1.0 + 0.5 * np.sign(np.sin(np.pi * t))
    before = gain * chirp.demand
    noise = 1e-9 * np.random.default_rng(2).standard_normal(len(t))
    both = replace(
        chirp,
        measured={**chirp.measured, "position": 1.02 * before + noise},
        simulated={"before": {"position": before, "force": 0.0 * t}},
    )
    found = estimate_response(both)
    inside = (found.frequency > 4.0) & (found.frequency < 90.0)
    assert found.coherence[inside].min() < 0.9
    assert found.excited[inside].mean() > 0.9
    ratio = found.response["measured"] / found.response["before"]
    assert np.abs(ratio[found.excited] - 1.02).max() < 0.02


def test_what_the_demand_does_not_contain_is_not_excited(chirp):
    found = estimate_response(chirp)
    assert not found.excited[found.frequency > 200.0].any()


def test_missed_samples_are_bridged(chirp):
    missed = np.arange(len(chirp.position)) % 50 == 0
    position = np.where(missed, 1.0, chirp.measured["position"])
    found = estimate_response(
        replace(chirp, valid=~missed, measured={**chirp.measured, "position": position})
    )
    inside = (found.frequency > 4.0) & (found.frequency < 40.0)
    error = found.response["measured"][inside] / exact(found.frequency[inside]) - 1.0
    assert np.abs(error).max() < 0.05


def test_no_segment_reaches_across_two_recordings(chirp):
    apart = estimate_response(replace(chirp, starts=(0, 8000)))
    assert np.abs(apart.response["before"][apart.excited] - 1.0).max() < 1e-9


def test_without_demand_motion_or_length_there_is_no_response(chirp):
    assert estimate_response(replace(chirp, demand=None)) is None
    assert estimate_response(replace(chirp, demand=np.zeros(16000))) is None
    assert estimate_response(replace(chirp, starts=tuple(range(0, 16000, 500)))) is None


def test_without_a_valid_position_there_is_no_response(chirp):
    assert estimate_response(replace(chirp, valid=np.zeros(len(chirp.valid), dtype=bool))) is None
