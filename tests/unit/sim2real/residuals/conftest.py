"""A course made of strokes there and back, with forces to put on it."""

from dataclasses import replace

import numpy as np
import pytest

from sim2real.phases import REST, SETTLING, split_phases
from sim2real.residuals.course import Course

PERIOD = 1e-3


def course_of(position, residual=0.0, starts=(0,), after=None):
    """A course along a demand that the axis follows exactly; the model's force is zero."""
    phases = split_phases(position, PERIOD)
    measured = {"position": position, "force": np.zeros(len(position)) + residual}
    zero = {"position": position, "force": np.zeros(len(position))}
    simulated = {"before": zero}
    if after is not None:
        simulated["after"] = {"position": position, "force": np.zeros(len(position)) + after}
    return Course(
        axis="x", period=PERIOD, starts=starts, demand=position, position=position,
        velocity=phases.velocity, moving=(phases.phase != REST) & (phases.phase != SETTLING),
        valid=np.ones(len(position), dtype=bool), strokes=phases.strokes,
        measured=measured, simulated=simulated,
    )  # fmt: skip


@pytest.fixture
def strokes():
    """Position of a sine of 20 mm and 0.5 Hz, 8 s, which reverses every second."""
    return 0.02 * np.sin(np.pi * PERIOD * np.arange(8000))


@pytest.fixture
def course(strokes):
    return course_of(strokes)


@pytest.fixture
def with_residual(course):
    """The same course with a residual force made of (position, velocity)."""

    def put(force):
        values = np.zeros(len(course.position)) + force(course.position, course.velocity)
        return replace(course, measured={**course.measured, "force": values})

    return put
