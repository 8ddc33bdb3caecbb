"""Figures found from responses that another model computes: matrices from tick to tick.

`estimation.observer.loop` takes the mechanics exactly, by a matrix exponential, where the fit has
them in closed form over frequency.
"""

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


def test_an_axis_as_believed():
    figures = found().figures
    assert figures.mass == pytest.approx(8.0, rel=0.01)
    assert figures.kp == pytest.approx(341e3, rel=0.02)
    assert figures.kd == pytest.approx(2714.0, rel=0.02)
    assert figures.stiffness == pytest.approx(6e5, rel=0.03)
    assert figures.resonances == ()
    assert figures.sign == 1.0
    for time in (figures.lateness, figures.age + figures.smoothing, figures.dead_time):
        assert abs(time) < 5e-5


@pytest.mark.parametrize("factor", [0.5, 0.7, 1.5])
def test_gains_that_are_not_those_of_the_file(factor):
    drive = DriveLoop(341e3 * factor, 16.07e6 * factor, 2714.0 * factor, 8.842e-4, 1500.0, 1e-4)
    figures = found(drive).figures
    assert figures.kp == pytest.approx(341e3 * factor, rel=0.03)
    assert figures.kd == pytest.approx(2714.0 * factor, rel=0.03)
    assert figures.mass == pytest.approx(8.0, rel=0.02)


@pytest.mark.parametrize("mass", [5.4, 16.0])
def test_another_mass(mass):
    assert found(carriage=Carriage(mass, 6e5, 20.0)).figures.mass == pytest.approx(mass, rel=0.01)


@pytest.mark.parametrize(("late", "old", "sign"), [(3, 0, 1), (5, 0, 1), (0, 1, 1), (2, 1, -1)])
def test_what_is_late_or_reversed_on_the_bus(late, old, sign):
    figures = found(late=late, old=old, sign=sign).figures
    assert figures.sign == sign
    assert figures.lateness == pytest.approx(late * PERIOD, abs=5e-5)
    assert figures.age + figures.smoothing == pytest.approx(old * PERIOD, abs=5e-5)
    assert figures.mass == pytest.approx(8.0, rel=0.01)


def test_dead_time_in_the_loop():
    drive = DriveLoop(341e3, 16.07e6, 2714.0, 8.842e-4, 1500.0, 1e-4, delay=5e-4)
    figures = found(drive).figures
    assert figures.dead_time == pytest.approx(5e-4, abs=5e-5)
    assert abs(figures.age + figures.smoothing) < 5e-5


@pytest.mark.parametrize(("ratio", "frequency"), [(0.2, 250.0), (0.05, 120.0), (0.3, 280.0)])
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


@pytest.mark.parametrize("factor", [0.1, 2.0])
def test_a_derivative_that_is_smoothed_otherwise_is_no_other_cause(factor):
    """It was taken for kp, dead time and mass."""
    drive = DriveLoop(341e3, 16.07e6, 2714.0, 8.842e-4 * factor, 1500.0, 1e-4)
    figures = found(drive).figures
    assert figures.derivative_time == pytest.approx(8.842e-4 * factor, rel=0.05)
    assert figures.kp == pytest.approx(341e3, rel=0.03)
    assert figures.mass == pytest.approx(8.0, rel=0.03)
    assert abs(figures.dead_time) < 6e-5


def test_a_drive_without_integrator_and_smoothing():
    drive = DriveLoop(341e3, 0.0, 2714.0, 0.0, 1500.0, 1e-4)
    rest = simulated(drive, CARRIAGE, seed=1)
    sliding = simulated(drive, CARRIAGE, slides=True, seed=2)
    believed = BELIEVED._replace(ki=0.0, derivative_time=0.0)
    fitted = fit(AxisResponse(rest, sliding), CLOCKING, believed)
    assert fitted.figures.kp == pytest.approx(341e3, rel=0.03)
    assert fitted.figures.ki == fitted.figures.derivative_time == 0.0
    assert "ki" not in fitted.sigma
