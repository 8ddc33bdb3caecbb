"""Known forces along a path: hysteresis, bases, coupling, velocity."""

import math

import numpy as np
import pytest

from estimation.known_effects import KnownForces, KnownTerms, Path
from estimation.known_effects.terms import Base
from stagedata import FrictionFigures

TS = 1e-3
MASS = 14.0
FRICTION = FrictionFigures(10, 6.0, 20.0, 6e5, 100.0, 0.2, 1e-3, 2.0)


def path(position, acceleration=None, across=None):
    position = np.asarray(position, np.float64)
    still = np.zeros(len(position))
    return Path(
        position,
        np.gradient(position, TS) if len(position) > 1 else still,
        still if acceleration is None else acceleration,
        still if across is None else across,
    )


def test_an_element_stretches_slides_and_turns():
    forces = KnownForces(KnownTerms(hysteresis=[(1.0, 2000.0)]), MASS, FRICTION, TS)
    state = forces.at_start()
    there = path([0.1, 0.1002, 0.1005, 0.12, 0.1199, 0.119, 0.05])
    np.testing.assert_allclose(
        forces.along(there, state), [0.0, 0.4, 1.0, 1.0, 0.8, -1.0, -1.0], atol=1e-9
    )
    # The next path goes on from there, not from its own first sample.
    np.testing.assert_allclose(forces.along(path([0.0502, 0.0503]), state), [-0.6, -0.4])


def test_several_elements_add_up():
    both = KnownForces(KnownTerms(hysteresis=[(1.0, 2000.0), (0.5, 4000.0)]), MASS, FRICTION, TS)
    way = path(np.linspace(0.0, 1e-3, 11))
    total = both.along(way, both.at_start())
    parts = [
        KnownForces(KnownTerms(hysteresis=[element]), MASS, FRICTION, TS)
        for element in ((1.0, 2000.0), (0.5, 4000.0))
    ]
    np.testing.assert_allclose(total, sum(p.along(way, p.at_start()) for p in parts))


def integrated(bases, acceleration, fine=400):
    """Mass times the bases' acceleration at each sample, by small steps of the equations."""
    dt = TS / fine
    b, v = np.zeros(len(bases)), np.zeros(len(bases))
    rate = np.array([2 * math.pi * base.frequency for base in bases])
    damping = np.array([base.damping for base in bases])
    ratio = np.array([base.mass_ratio for base in bases])

    def swing(a):
        pull = rate**2 * b + 2 * damping * rate * v
        net = a - (pull.sum() + ratio.sum() * a) / (1 + ratio.sum())
        return -(pull + ratio * net)

    force, before = [], 0.0
    for a in acceleration:
        for i in range(fine):
            v = v + dt * swing(before + (a - before) * (i + 0.5) / fine)
            b = b + dt * v
        force.append(MASS * swing(a).sum())
        before = a
    return np.array(force)


@pytest.mark.parametrize(
    "bases", [[Base(0.03, 9.0, 0.08)], [Base(0.03, 9.0, 0.08), Base(0.02, 14.0, 0.05)]]
)
def test_a_base_swings_as_its_equation_says(bases):
    acceleration = np.concatenate((np.full(20, 3.0), np.full(20, -3.0), np.zeros(40)))
    forces = KnownForces(KnownTerms(bases=bases), MASS, FRICTION, TS)
    state = forces.at_start()
    found = forces.along(path(np.zeros(80), acceleration), state)
    expected = integrated(bases, np.concatenate((acceleration, np.zeros(30))))
    assert np.abs(expected[40:80]).max() > 0.2
    np.testing.assert_allclose(found, expected[:80], atol=2e-3)
    # At rest it goes on by itself.
    assert forces.sway(state) == pytest.approx(found[-1])
    later = state.copy()
    np.testing.assert_allclose(forces.sway_at_rest(later, 30), expected[80:], atol=2e-3)
    forces.rest(state, 30 * TS)
    assert forces.sway(state) == pytest.approx(forces.sway(later), abs=1e-9)


def test_acceleration_of_the_other_axis_and_velocity():
    terms = KnownTerms(coupled_mass=0.4, velocity_forces=[lambda v: 50.0 * v * np.abs(v)])
    forces = KnownForces(terms, MASS, FRICTION, TS)
    across = np.array([0.0, 2.0, -2.0])
    way = path(np.array([0.0, 1e-4, 2e-4]), across=across)
    np.testing.assert_allclose(forces.along(way, forces.at_start()), 0.4 * across + 0.5)


def test_friction_over_velocity_goes_with_the_stated_figures_and_known_factors():
    terms = KnownTerms(
        viscous=1.5,
        friction_forces=[lambda v, friction: friction.coulomb + friction.viscous * np.abs(v)],
    )
    forces = KnownForces(terms, MASS, FRICTION, TS)
    way = path(np.array([0.0, 1e-4, 2e-4]))
    np.testing.assert_allclose(forces.along(way, forces.at_start()), 6.0 + 1.5 * 20.0 * 0.1)
