"""Figures found from responses that another model computes: matrices from tick to tick.

`estimation.observer.loop` takes the mechanics exactly, by a matrix exponential, where the fit has
them in closed form over frequency.
"""

from dataclasses import replace

import numpy as np
import pytest

from estimation.observer import Carriage, DriveLoop, Mode
from estimation.observer.loop import period_maps
from estimation.response import (
    AxisResponse,
    Clocking,
    Figures,
    evaluate,
    fit,
    make_excitation,
)
from estimation.response.excitation import Shaken

PERIOD = 1e-3
DRIVE = DriveLoop(341e3, 16.07e6, 2714.0, 8.842e-4, 1500.0, 1e-4)
CARRIAGE = Carriage(8.0, 6e5, 20.0)
CLOCKING = Clocking(PERIOD, 1e-4, 1500.0)
BELIEVED = Figures(8.0, 341e3, 16.07e6, 2714.0, 8.842e-4, viscous=20.0, stiffness=6e5)
SHAKEN = Shaken(0.6, 341e3, 16.07e6, 2714.0, 8.842e-4)


def simulated(drive, carriage, *, late=0, old=0, sign=1.0, slides=False, seed=1):
    """The response of an axis to whole periods of its excitation, measured with 1 nm of noise."""
    excitation = make_excitation([SHAKEN], PERIOD)
    stuck = Carriage(
        carriage.mass, 0.0 if slides else carriage.stiffness, carriage.viscous, carriage.hung
    )
    maps = period_maps(drive, stuck, PERIOD)
    periods, rows = 4, len(excitation)
    offset = np.tile(excitation.offset[:, 0], periods)
    demand = np.tile(excitation.demand[:, 0], periods)
    acting = sign * np.concatenate((np.zeros(late), offset))[: len(offset)]
    state, before, position = np.zeros(len(maps.transition)), 0.0, np.zeros(len(offset))
    # a demand acts on the error as a reading that is too low by it, tick by tick as it is ramped
    shares = np.arange(1, 11) / 10.0
    r_before = 0.0
    for k in range(len(offset)):
        position[k] = state[0]
        ramp = r_before + (demand[k] - r_before) * shares
        state = maps.transition @ state + maps.noise @ -ramp
        state = state + maps.ramp_from * before + maps.ramp_to * acting[k]
        before, r_before = acting[k], demand[k]
    position = np.concatenate((np.zeros(old), position))[: len(offset)]
    position = position + np.random.default_rng(seed).normal(0.0, 1e-9, len(position))
    cut = [x.reshape(periods, rows)[2:] for x in (position, demand, offset)]
    lines = (excitation.offset_lines[0], excitation.demand_lines[0], excitation.empty_lines)
    return evaluate(*cut, lines, PERIOD)


def found(drive=DRIVE, carriage=CARRIAGE, **odd):
    rest = simulated(drive, carriage, seed=1, **odd)
    sliding = simulated(drive, carriage, slides=True, seed=2, **odd)
    return fit(AxisResponse(rest, sliding), CLOCKING, BELIEVED)


KP, KD, TIME = DRIVE.kp, DRIVE.kd, DRIVE.derivative_time


@pytest.mark.parametrize(
    ("drive", "mass", "odd", "expected"),
    [
        ({}, 8.0, {}, {"kp": KP, "stiffness": 6e5}),
        *(
            (
                {"kp": KP * f, "ki": DRIVE.ki * f, "kd": KD * f},
                8.0,
                {},
                {"kp": KP * f, "kd": KD * f},
            )
            for f in (0.5, 1.5)
        ),
        ({}, 5.4, {}, {}),
        ({}, 16.0, {}, {}),
        ({}, 8.0, {"late": 5}, {"lateness": 5 * PERIOD}),
        ({}, 8.0, {"old": 1}, {"age": PERIOD}),
        ({}, 8.0, {"late": 2, "old": 1, "sign": -1}, {"lateness": 2 * PERIOD, "age": PERIOD}),
        ({"delay": 5e-4}, 8.0, {}, {"dead_time": 5e-4}),
        # It was taken for kp, dead time and mass.
        ({"derivative_time": 0.1 * TIME}, 8.0, {}, {"derivative_time": 0.1 * TIME, "kp": KP}),
        ({"derivative_time": 2.0 * TIME}, 8.0, {}, {"derivative_time": 2.0 * TIME, "kp": KP}),
    ],
)
def test_what_differs_is_found_and_nothing_else(drive, mass, odd, expected):
    expected = dict(expected)
    figures = found(replace(DRIVE, **drive), replace(CARRIAGE, mass=mass), **odd).figures
    for name in ("lateness", "age", "dead_time"):
        value = getattr(figures, name) + (figures.smoothing if name == "age" else 0.0)
        assert value == pytest.approx(expected.pop(name, 0.0), abs=6e-5), name
    for name, value in expected.items():
        assert getattr(figures, name) == pytest.approx(value, rel=0.03), name
    assert figures.kd == pytest.approx(drive.get("kd", KD), rel=0.03)
    assert figures.mass == pytest.approx(mass, rel=0.03 if drive else 0.01)
    assert figures.sign == odd.get("sign", 1)
    assert figures.resonances == ()


@pytest.mark.parametrize(("ratio", "frequency"), [(0.05, 120.0), (0.3, 280.0)])
def test_a_resonance_that_the_file_does_not_have(ratio, frequency):
    axis = Carriage(8.0, 6e5, 20.0, (Mode(ratio, frequency, 0.01),))
    fitted = found(carriage=axis)
    (mode,) = fitted.figures.resonances
    assert mode.frequency == pytest.approx(frequency, rel=0.01)
    assert mode.share == pytest.approx(ratio / (1.0 - ratio), rel=0.15)
    assert fitted.figures.mass == pytest.approx(8.0, rel=0.02)


def test_steps_of_the_offset_show_as_distortion():
    """Lines that nobody shakes hold what rounding adds: step / sqrt(12) rms."""
    excitation = make_excitation([SHAKEN], PERIOD)
    rows, step = len(excitation), 0.2
    rng = np.random.default_rng(3)
    offset = np.tile(excitation.offset[:, 0], 2).reshape(2, rows)
    acting = step * np.round(offset / step)
    spring = 1e-6  # an axis that answers at once
    position = spring * acting + rng.normal(0.0, 1e-9, offset.shape)
    demand = np.tile(excitation.demand[:, 0], 2).reshape(2, rows)
    lines = (excitation.offset_lines[0], excitation.demand_lines[0], excitation.empty_lines)
    response = evaluate(position + demand, demand, offset, lines, PERIOD)
    assert response.distortion * np.sqrt(12.0) == pytest.approx(step, rel=0.25)
    finer = evaluate(spring * offset + demand, demand, offset, lines, PERIOD)
    assert finer.distortion < 1e-6


def test_the_signals_share_no_line_and_keep_their_peak():
    excitation = make_excitation([SHAKEN, SHAKEN], PERIOD)
    lines = [*excitation.offset_lines, *excitation.demand_lines, excitation.empty_lines]
    assert len(np.unique(np.concatenate(lines))) == sum(len(of) for of in lines)
    assert np.abs(excitation.offset).max() == pytest.approx(0.6)


def test_a_drive_without_integrator_and_smoothing():
    drive = DriveLoop(341e3, 0.0, 2714.0, 0.0, 1500.0, 1e-4)
    rest = simulated(drive, CARRIAGE, seed=1)
    sliding = simulated(drive, CARRIAGE, slides=True, seed=2)
    believed = BELIEVED._replace(ki=0.0, derivative_time=0.0)
    fitted = fit(AxisResponse(rest, sliding), CLOCKING, believed)
    assert fitted.figures.kp == pytest.approx(341e3, rel=0.03)
    assert fitted.figures.ki == fitted.figures.derivative_time == 0.0
    assert "ki" not in fitted.sigma
