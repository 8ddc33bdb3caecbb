"""Axes for the tests of the observer, and one that is simulated tick by tick."""

from __future__ import annotations

import numpy as np

from estimation.observer import AxisFigures, BusUnits, Carriage, DriveLoop, StageObserver

PERIOD = 1e-3
DRIVE = DriveLoop(341e3, 16.07e6, 2714.0, 8.842e-4, 1500.0, 1e-4)
CARRIAGE = Carriage(8.0, 6e5, 20.0)
FIGURES = AxisFigures(DRIVE, CARRIAGE, 6.0, 1.04e-9, PERIOD, 20.0)
UNITS = BusUnits(1e-12, 1e-4, 120.0)
"""So fine that rounding does not matter."""


class Plant:
    """An axis at rest, integrated with small steps; friction is a spring.

    Attributes:
        deviation: from the demand [m].  integral: of the drive [N].
    """

    def __init__(self, drive=DRIVE, carriage=CARRIAGE):
        self.drive, self.carriage = drive, carriage
        self.deviation = self.velocity = self.force = self.integral = 0.0
        self.slope = self.last = 0.0

    def advance(self, start, end, push, noise, steps=50):
        """One SYNC period; returns the following error of each tick [m].

        Args:
            start: force offset before it [N].
            end: force offset at its end [N].
            push: force against the motion [N].
            noise: of the encoder in each tick [m].
            steps: per tick.
        """
        d, c = self.drive, self.carriage
        pole, dt = 2.0 * np.pi * d.current_bandwidth, d.control_period / steps
        errors = np.zeros(len(noise))
        for j in range(len(noise)):
            offset = start + (end - start) * (j + 1) / len(noise)
            error = -(self.deviation + noise[j])
            share = d.control_period / (d.derivative_time + d.control_period)
            self.slope += share * ((error - self.last) / d.control_period - self.slope)
            self.last = error
            output = d.kp * error + self.integral + d.kd * self.slope + offset
            self.integral += d.ki * error * d.control_period
            errors[j] = error
            for _ in range(steps):
                self.force += (output - self.force) * pole * dt
                net = self.force - c.stiffness * self.deviation - c.viscous * self.velocity - push
                self.velocity += net / c.mass * dt
                self.deviation += self.velocity * dt
        return errors


def closed_loop(design, pushes, noise, plant=None):
    """An axis that holds its place under the observer's kernel.

    Args:
        design: of the observer.
        pushes: force against the motion in each SYNC period [N], shape (K,).
        noise: of the encoder in each tick [m], shape (K, n).
        plant: the axis; None: as `FIGURES` says.

    Returns:
        Deviation at each SYNC [m], shape (K,); following error in each tick [m], shape (K, n);
        force offset in each SYNC period [N], shape (K,).
    """
    plant = plant or Plant()
    rows = len(pushes)
    observer = StageObserver([design], [UNITS], PERIOD, 1e-4)
    observer.begin(np.zeros((rows, 1), np.int64), np.zeros((rows, 1)), [0], False)
    deviation, errors, offsets = np.zeros(rows), np.zeros_like(noise), np.zeros(rows)
    before = 0.0
    for k in range(rows):
        sent = observer.offsets(k, 1, 0.0)[0] * UNITS.force
        deviation[k], offsets[k] = plant.deviation, sent
        reading = plant.deviation + noise[k, 0]
        errors[k] = plant.advance(before, sent, pushes[k], noise[k])
        observer.sample[0] = (round(reading / UNITS.increment), 0, 1, 0)
        before = sent
    return deviation, errors, offsets
