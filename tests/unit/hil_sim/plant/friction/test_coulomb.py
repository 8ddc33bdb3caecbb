"""The plant's Coulomb-Stribeck law: rest is rest, and in motion the force follows the speed."""

from dataclasses import replace

import numpy as np
import pytest

from hil_sim.effects.library import own_effects
from hil_sim.plant import simulate
from tests.unit.hil_sim.inputs import OPEN, change_axes

EFFECTS = own_effects()
FRICTION_EFFECTS = sorted(
    name for name, e in EFFECTS.items() if e.group == "friction" and name != "presliding_stiffness"
)
MASS, COULOMB, STATIC = 8.0, 6.0, 1.4 * 6.0


@pytest.fixture(scope="module")
def coulomb(nominal):
    figures = {"elements": 0, "stiffness": 0.0, "relaxation_rate": 0.0, "law": "coulomb"}
    return change_axes(nominal, figures, increment=1e-13)


@pytest.fixture(scope="module")
def loose(coulomb):
    """Open loops, no viscous friction: the motor gets the force offset, nothing else."""
    return change_axes(coulomb, {"viscous": 0.0}, OPEN)


def pushed(stage, force, substeps=20):
    """Position of x, y under these forces on x [m]."""
    offset = np.column_stack([force, np.zeros_like(force)])
    return simulate(stage, np.zeros_like(offset), offset, None, substeps=substeps).position


def with_effect(stage, name, **values):
    x, y = stage.axes
    return replace(stage, axes=(replace(x, effects=(EFFECTS[name].at(**values),)), y))


@pytest.mark.parametrize("share", [0.99, -0.99])
def test_below_the_static_limit_nothing_moves(loose, share):
    force = np.linspace(0.0, share * STATIC, 200)
    assert np.abs(pushed(loose, force)).max() == 0.0


def test_beyond_the_static_limit_it_breaks_away(loose):
    moved = pushed(loose, np.linspace(0.0, 1.05 * STATIC, 200))[:, 0]
    first = int(np.flatnonzero(moved)[0])
    assert 1.0 < np.linspace(0.0, 1.05, 200)[first] < 1.01


def test_it_slides_with_the_coulomb_force(loose):
    position = pushed(loose, np.full(400, 14.0))[:, 0]
    acceleration = np.diff(position[100:], 2) / 1e-6  # far above the Stribeck velocity
    assert acceleration == pytest.approx((14.0 - COULOMB) / MASS, rel=1e-5)


def test_without_force_it_stops_and_stays(loose):
    force = np.where(np.arange(600) < 100, 14.0, 0.0)
    position = pushed(loose, force)[:, 0]
    slowing = np.diff(position[150:200], 2) / 1e-6
    assert slowing == pytest.approx(-COULOMB / MASS, rel=1e-5)
    assert np.ptp(position[-200:]) == 0.0
    assert (np.diff(position) >= 0.0).all()


def test_finer_steps_tell_the_same(loose):
    force = 12.0 * np.sin(np.arange(400) / 40.0)
    one, other = pushed(loose, force, 5), pushed(loose, force, 50)
    assert np.abs(one - other).max() < 1e-2 * np.abs(other).max()


def test_rest_force_is_held_as_far_as_the_limit_allows(coulomb):
    still = np.zeros((300, 2))
    response = simulate(coulomb, still, still, None, rest_force=[8.0, -6.0], rounded=False)
    assert response.force == pytest.approx(np.tile([8.0, -6.0], (300, 1)), abs=1e-9)
    assert np.abs(response.position).max() == 0.0
    beyond = simulate(coulomb, still, still, None, rest_force=[9.0, 0.0], rounded=False)
    assert beyond.force[0, 0] == pytest.approx(STATIC)


def test_an_axis_at_rest_does_not_creep_while_the_other_pushes_it(loose):
    x, y = loose.axes
    pulled = replace(y, effects=(EFFECTS["cross_coupling"].at(mass=1.5),))
    stage = replace(loose, axes=(x, pulled))
    position = pushed(stage, 30.0 * np.sin(np.arange(400) / 20.0))
    assert np.ptp(position[:, 0]) > 5e-3
    assert np.abs(position[:, 1]).max() < 1e-12
    assert np.abs(pushed(stage, np.full(400, 200.0))[:, 1]).max() > 1e-3  # enough to move it


def steady_force(stage):
    """Force of x on a slide of 40 mm and back at 0.1 m/s, its ends left out [N]."""
    there = np.linspace(0.0, 0.04, 400)
    demand = np.concatenate([there, there[::-1]])
    force = simulate(
        stage, np.column_stack([demand, 0.0 * demand]), np.zeros((800, 2)), None, rounded=False
    ).force[:, 0]
    return np.concatenate([force[150:390], force[550:790]])


@pytest.mark.parametrize("name", FRICTION_EFFECTS)
def test_friction_effects_act_under_both_laws(nominal, coulomb, name):
    """Where all elements slide, the laws are one."""
    values = {
        p.key: 0.02 if p.role == "place" else p.ranges(nominal.axes[0])[-1][1]
        for p in EFFECTS[name].parameters
    }
    plain = steady_force(coulomb)
    changed = steady_force(with_effect(coulomb, name, **values)) - plain
    expected = steady_force(with_effect(nominal, name, **values)) - steady_force(nominal)
    assert np.sqrt(np.mean(np.square(changed - expected))) < 0.1 + 0.1 * np.abs(expected).max()


def test_presliding_stiffness_needs_presliding(coulomb):
    with pytest.raises(ValueError, match=r"^axis x: .*: the friction law coulomb has no"):
        simulate(
            with_effect(coulomb, "presliding_stiffness", ratio=2.0),
            np.zeros((2, 2)), np.zeros((2, 2)), None,
        )  # fmt: skip
