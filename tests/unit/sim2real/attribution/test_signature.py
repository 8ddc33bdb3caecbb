"""Forces that effects add along a motion, against closed forms."""

import numpy as np
import pytest

from hil_sim.effects.library import library
from sim2real.attribution.signature import effect_inputs
from sim2real.fitting import Term
from sim2real.tracking import Track

PERIOD, COUNT = 1e-3, 20_000
TIME = np.arange(COUNT) * PERIOD
SPEED = 0.05 * np.cos(3.0 * TIME)
TRACK = Track(
    np.zeros(COUNT), np.zeros(COUNT), np.ones(COUNT, bool), 0.02 * np.sin(TIME), SPEED,
    np.full(COUNT, 7.0), np.ones(COUNT),
)  # fmt: skip


def inputs(stage, effect, acceleration=None, **values):
    known = library()[effect]
    term = Term(known, tuple(values[p.key] for p in known.parameters))
    nothing = np.zeros(COUNT) if acceleration is None else acceleration
    return effect_inputs(stage.axes[0], term, TRACK, TIME, nothing)


@pytest.mark.parametrize(
    ("effect", "inertia", "softer"), [("resonance", 0.0, -1.0), ("base_motion", 1.0, 0.0)]
)
def test_a_mode_answers_an_oscillation_at_its_frequency(stage, effect, inertia, softer):
    """Amplitude m r / |g - i + 2 d g j|, with i and g of a hanging mass or of a base."""
    ratio, damping, frequency = 0.2, 0.03, 80.0
    swing = np.sin(2.0 * np.pi * frequency * TIME)
    found = inputs(stage, effect, swing, frequency=frequency, damping=damping, mass_ratio=ratio)
    g, i = 1.0 + softer * ratio, 1.0 + inertia * ratio
    expected = stage.axes[0].mass * ratio / abs(g - i + 2j * damping * g)
    settled = found.force[COUNT // 2 :]
    assert np.sqrt(2.0) * settled.std() == pytest.approx(expected, rel=0.02)
    assert found.level is None


def test_forces_and_factors_are_those_of_their_equations(stage):
    mass = inputs(stage, "payload_mass", SPEED, mass=1.5)
    np.testing.assert_allclose(mass.force, -1.5 * SPEED, atol=1e-12)
    warm = inputs(stage, "thermal_drift", amplitude=0.2, time_constant=4.0)
    np.testing.assert_allclose(warm.level, 0.2 * np.exp(-TIME / 4.0))
    assert inputs(stage, "dead_time", delay=1e-3) is None
