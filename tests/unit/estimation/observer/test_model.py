"""The observer's model: what it leaves out cannot be seen, and its gain is the best one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from estimation.observer.loop import DEVIATION, INTEGRAL, period_maps
from estimation.observer.model import LACK, make_model
from tests.unit.estimation.observer.axes import CARRIAGE, DRIVE, PERIOD

WALK, NOISE = 0.3, 2e-9


@pytest.fixture(params=[(0.0, 1.0), (0.25e-3, 1.1)], ids=["plain", "late and strong"])
def model_and_drive(request):
    delay, ratio = request.param
    drive = replace(DRIVE, delay=delay, force_ratio=ratio)
    return make_model(drive, CARRIAGE, PERIOD, WALK, NOISE), drive


def test_it_predicts_what_the_axis_does(model_and_drive):
    model, drive = model_and_drive
    maps = period_maps(drive, CARRIAGE, PERIOD)  # type: ignore[arg-type]
    generator = np.random.default_rng(2)
    push, before = 1.3, 0.0
    axis, seen = np.zeros(len(maps.transition)), np.zeros(len(model.gain))
    seen[LACK] = push
    for _ in range(60):
        offset = generator.normal()
        axis = maps.transition @ axis + maps.ramp_from * before + maps.ramp_to * offset
        axis = axis + maps.disturbance * push
        seen = model.transition @ seen + model.ramp_from * before + model.ramp_to * offset
        before = offset
        assert seen[DEVIATION] == pytest.approx(axis[DEVIATION], rel=1e-6, abs=1e-14)
    assert seen[LACK] == pytest.approx(push - model.force_ratio * axis[INTEGRAL], rel=1e-6)


def test_the_gain_leaves_the_spread_it_states():
    model = make_model(DRIVE, CARRIAGE, PERIOD, WALK, NOISE)
    generator = np.random.default_rng(3)
    states = len(model.gain)

    def spread(gain):
        error, squares = np.zeros(states), []
        for walk, noise in generator.normal(size=(20_000, 2)):
            innovation = error[DEVIATION] + NOISE * noise
            squares.append(innovation**2)
            error = model.transition @ (error - gain * innovation)
            error[LACK] += WALK * walk
        return float(np.sqrt(np.mean(squares[100:])))

    best = spread(model.gain)
    assert best == pytest.approx(model.spread, rel=0.02)
    for factor in (0.85, 1.05):
        assert spread(factor * model.gain) > best
