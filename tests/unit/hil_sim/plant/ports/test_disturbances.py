"""The factor on the Coulomb level, uncompiled; all that ports do: effects/test_equations.py."""

from types import SimpleNamespace

import pytest

from hil_sim.plant.ports.disturbances import (
    coulomb_factor,
)

FORWARD, BACKWARD = 1.2, 0.9


@pytest.mark.parametrize(("direction", "factor"), [(1.0, FORWARD), (-1.0, BACKWARD)])
def test_the_coulomb_factor_is_linear_about_its_place_and_depends_on_the_way(direction, factor):
    p = SimpleNamespace(coulomb_forward=FORWARD, coulomb_backward=BACKWARD, load_friction=0.0)
    s = SimpleNamespace(
        coulomb=1.5, coulomb_slope=100.0, position=0.011, place=0.010, transmitted=-5.0
    )
    assert coulomb_factor.py_func(p, s, direction) == pytest.approx(1.6 * factor)
    p.load_friction = 0.02
    assert coulomb_factor.py_func(p, s, direction) == pytest.approx(1.6 * factor + 0.1)
    s.position = -0.1  # a straight line would make friction drive the axis
    assert coulomb_factor.py_func(p, s, direction) == pytest.approx(0.1)


def test_dead_time_takes_the_earlier_output_for_its_share_of_the_substep():
    s = SimpleNamespace(late=10.0, later=4.0)
    arena = np.array([1.0, 0.25, 0.0])
    p = SimpleNamespace(history=0, delay_share=0)
    assert [delayed.py_func(p, s, arena, k) for k in range(3)] == [4.0, 8.5, 10.0]
    assert delayed.py_func(SimpleNamespace(history=-1), s, arena, 1) == 10.0


def test_force_over_velocity_is_exact_at_its_nodes_linear_between_and_held_beyond():
    half, scale = 4, 8.0  # nodes at (i/8)^2 m/s
    nodes = (np.arange(half + 1) / scale) ** 2
    forces = np.array([-9.0, -4.0, -2.0, -1.0, 0.5, 2.0, 3.0, 5.0, 11.0])
    p = SimpleNamespace(velocity_nodes=half, velocity_scale=scale, velocity_force=0)

    def force(v):
        return over_velocity.py_func(forces, p, v)

    for i, v in enumerate(nodes):
        assert force(v) == pytest.approx(forces[half + i])
        assert force(-v) == pytest.approx(forces[half - i])
    middle = 0.5 * (nodes[2] + nodes[3])
    assert force(middle) == pytest.approx(0.5 * (forces[half + 2] + forces[half + 3]))
    assert force(-middle) == pytest.approx(0.5 * (forces[half - 2] + forces[half - 3]))
    assert (force(9.0), force(-9.0)) == (11.0, -9.0)


def test_a_hysteretic_element_is_a_spring_up_to_its_limit():
    stiffness, limit = 1000.0, 2.0
    arena = np.array([stiffness, limit, 0.0])
    p = SimpleNamespace(hysteresis=0, hysteresis_count=1)
    assert drag.py_func(p, arena, 1e-3) == pytest.approx(1.0)
    assert drag.py_func(p, arena, 5e-3) == pytest.approx(1.0)  # saturated
    assert arena[2] == limit
    assert drag.py_func(p, arena, -1e-3) == pytest.approx(-1.0)  # it gives at once on the way back
    assert arena[2] == pytest.approx(1.0)


def test_a_part_on_the_carriage_swings_at_its_frequency_and_keeps_its_energy():
    mass, frequency, dt = 2.0, 40.0, 2e-5
    rate = 2.0 * math.pi * frequency
    arena = np.array([mass * rate**2, 0.0, mass, 1e-6, 0.0])
    p = SimpleNamespace(hanging=0, hanging_count=1, bases=0, bases_count=0, mass=8.0)
    s = SimpleNamespace(net=0.0, sprung=0.0)
    deflection = []
    for _ in range(round(0.1 / dt)):  # four periods; the carriage is held
        swing.py_func(p, s, arena, dt)
        deflection.append(arena[3])
    crossings = np.flatnonzero(np.diff(np.sign(deflection)))
    assert np.diff(crossings).mean() * dt == pytest.approx(0.5 / frequency, rel=1e-3)
    assert np.abs(deflection).max() == pytest.approx(1e-6, rel=1e-2)


def test_coupled_axes_are_solved_together():
    """a_i = b_i - M a_j / m_i: the kicks fulfil both equations at once."""
    masses, coupling, dt = (8.0, 14.0), 0.5, 2e-5
    mobility = np.diag(1.0 / np.array(masses))
    coupled = np.array([[0.0, coupling], [coupling, 0.0]])
    inverse = np.linalg.inv(np.eye(2) + mobility @ coupled)
    arena = np.concatenate([inverse.ravel(), coupled.ravel()])
    plant = np.zeros(2, dtype=[("coupling", "i8")]).view(np.recarray)
    free = np.array([3e-5, -1e-5])
    state = np.zeros(2, dtype=[("kick", "f8"), ("net", "f8")]).view(np.recarray)
    state.kick = free
    solve_jointly.py_func(plant, state, arena, dt)
    for a in range(2):
        assert state.kick[a] == pytest.approx(free[a] - coupling * state.kick[1 - a] / masses[a])
        assert state.net[a] == pytest.approx(-coupling * state.kick[1 - a] / dt)
