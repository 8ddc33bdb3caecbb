"""What is told of a stage that is not well, and that nothing is told of one that is."""

from types import SimpleNamespace

import numpy as np
import pytest

from stagectl.sequencer.unrest import Unrest, oscillation

PERIOD, WINDOW = 1e-3, 50e-9
RNG = np.random.default_rng(5)


def samples(error, force, demand=None):
    demand = np.zeros(len(error)) if demand is None else demand
    return SimpleNamespace(
        position_demand=demand[:, None], position=(demand + error)[:, None],
        force=force[:, None], valid=np.ones((len(error), 1), bool),
    )  # fmt: skip


def unrest():
    return Unrest(["x"], [1e-9], PERIOD)


@pytest.mark.parametrize("frequency", [12.0, 38.0, 140.0])
@pytest.mark.parametrize("speed", [0.0, 10e-6])
def test_an_oscillation_is_told_once_at_rest_or_at_a_constant_speed(frequency, speed):
    time = np.arange(600)
    error = 200e-9 * np.sin(2e-3 * np.pi * frequency * time) + RNG.normal(0.0, 1e-9, 600)
    watched = unrest()
    [text] = watched.in_samples(samples(error, np.zeros(600), speed * time), WINDOW)
    assert text.startswith("axis x: the following error oscillates at ")
    assert float(text.split(" at ")[1].split(" Hz")[0]) == pytest.approx(frequency, rel=0.1)
    assert watched.in_samples(samples(error, np.zeros(600)), WINDOW) == []


def test_a_force_that_oscillates_is_told():
    force = np.rint(10.0 * np.sin(0.2 * np.arange(300))) * 0.04
    [text] = unrest().in_samples(samples(np.zeros(300), force), WINDOW)
    assert "the force oscillates at 32 Hz, by 0.4 N" in text


def test_noise_and_creeping_are_no_oscillation():
    noise = RNG.normal(0.0, 1e-6, 2000)
    creep = 2e-6 * np.exp(-np.arange(500) / 60.0)
    steps = np.rint(RNG.normal(0.0, 1.0, 500)) * 0.04
    assert oscillation(noise, WINDOW, PERIOD) is None
    assert unrest().in_samples(samples(creep, steps), WINDOW) == []


def test_settling_that_gets_worse_is_told_once():
    watched = unrest()
    times = np.linspace(0.02, 0.09, 40)
    [text] = [text for t in times for text in watched.after_settling("macro", t)]
    assert text.startswith("macro-moves settle in ")


def test_settling_that_scatters_or_gets_better_is_not():
    for times in (RNG.exponential(0.03, 200), np.linspace(0.09, 0.02, 40)):
        watched = unrest()
        assert [text for t in times for text in watched.after_settling("micro", t)] == []
