"""The sensitivity: against textbook, against the kernel in time, and where a loop is unstable."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from estimation.observer.design import Design
from estimation.observer.loop import period_maps
from estimation.observer.model import make_model
from estimation.observer.sensitivity import drive_alone, peak_sensitivity, with_observer
from tests.unit.estimation.observer.axes import (
    CARRIAGE,
    DRIVE,
    FIGURES,
    PERIOD,
    closed_loop,
)

MAPS = period_maps(DRIVE, CARRIAGE, PERIOD)
MODEL = make_model(DRIVE, replace(CARRIAGE, stiffness=3e5), PERIOD, 0.3, 1e-9)


def test_the_drive_alone_is_as_its_transfer_functions_say():
    """A drive of fast ticks is nearly continuous."""
    drive = replace(DRIVE, control_period=1e-5)
    frequency = np.geomspace(2.0, 500.0, 4000)
    s = 2j * np.pi * frequency
    lag = 1.0 / (1.0 + s / (2.0 * np.pi * drive.current_bandwidth))
    plant = 1.0 / (CARRIAGE.mass * s**2 + CARRIAGE.viscous * s + CARRIAGE.stiffness)
    pid = drive.kp + drive.ki / s + drive.kd * s / (1.0 + s * drive.derivative_time)
    expected = np.abs(1.0 / (1.0 + pid * lag * plant)).max()
    found = peak_sensitivity(drive_alone(period_maps(drive, CARRIAGE, PERIOD)), PERIOD)
    assert found == pytest.approx(expected, rel=5e-3)


def test_an_observer_with_little_gain_changes_little():
    alone = peak_sensitivity(drive_alone(MAPS), PERIOD)
    assert peak_sensitivity(with_observer(MAPS, MODEL, 1e-6), PERIOD) == pytest.approx(
        alone, rel=1e-4
    )


def test_more_gain_more_latency_higher_peak():
    peaks = [peak_sensitivity(with_observer(MAPS, MODEL, gain), PERIOD) for gain in (0.1, 0.2, 0.4)]
    assert peaks == sorted(peaks)
    assert peak_sensitivity(with_observer(MAPS, MODEL, 0.2, 2), PERIOD) > peaks[1]


def test_an_unstable_loop_has_no_peak():
    heavy = period_maps(DRIVE, replace(CARRIAGE, mass=16.0, stiffness=0.0), PERIOD)
    stiff = make_model(DRIVE, CARRIAGE, PERIOD, 0.3, 1e-9)
    assert peak_sensitivity(with_observer(heavy, stiff, 0.5, 2), PERIOD) == float("inf")


@pytest.mark.parametrize("frequency", [40.0, 100.0])
def test_the_kernel_in_time_has_the_sensitivity_of_the_linear_loop(frequency):
    gain, rows = 0.15, 600
    time = np.arange(rows * 10).reshape(rows, 10) * 1e-4
    noise = 1e-8 * np.sin(2.0 * np.pi * frequency * time)  # below what is clipped
    design = Design(FIGURES, MODEL, gain, 3e5)
    _, errors, _ = closed_loop(design, np.zeros(rows), noise)
    settled = slice(rows // 2, rows)  # whole periods of the sine
    wave = np.exp(-2j * np.pi * frequency * time[settled])
    measured = abs((errors[settled] * wave).mean()) / abs((noise[settled] * wave).mean())
    assert measured == pytest.approx(sensitivity_at(frequency, gain), rel=0.01)


def sensitivity_at(frequency, gain):
    loop = with_observer(MAPS, MODEL, gain)
    z = np.exp(2j * np.pi * frequency * PERIOD)
    wave = np.exp(2j * np.pi * frequency * 1e-4 * np.arange(10))
    state = np.linalg.solve(z * np.eye(len(loop.a)) - loop.a, loop.b @ wave)
    return float(abs(wave.conj() @ (loop.c @ state + loop.d @ wave)) / 10.0)
