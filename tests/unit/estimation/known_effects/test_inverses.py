"""The host's equations of the effects, against the simulator's ports, made by other code."""

import math

import numpy as np
import pytest

from estimation.known_effects import KnownTerms, coulomb_factor, inverses, known_figures
from hil_sim.effects.library import own_effects
from hil_sim.effects.ports import EffectPorts
from stagectl.config import load_machine, stage_settings

AXIS = stage_settings(load_machine()).axes[0]
EFFECTS = own_effects()
AMPLITUDE, LENGTH, SEED = 0.2, 0.05, 7  # of a field
X = np.linspace(-0.14, 0.14, 997)
Y = np.linspace(0.11, -0.13, 997)


def drawn(name, seed=3):
    """Values of an effect somewhere in their ranges."""
    generator = np.random.default_rng([seed, len(name)])
    return {p.key: generator.uniform(*p.ranges(AXIS)[-1]) for p in EFFECTS[name].parameters}


def terms_of(name, values):
    terms = KnownTerms()
    getattr(inverses, name)(terms, values)
    return terms


def ports_of(name, values):
    ports = EffectPorts(AXIS, 1e-3, 1.0)
    EFFECTS[name].at(**values).apply(ports)
    return ports


@pytest.mark.parametrize("name", ["cogging", "force_offset", "cable_stiffness"])
def test_forces_over_position(name):
    values = drawn(name)
    (force,) = terms_of(name, values).forces
    ports = ports_of(name, values)
    expected = [ports.standing_force(x) for x in X]
    np.testing.assert_allclose(force(X), expected, atol=2e-4)


def test_ripple_over_position():
    values = drawn("force_ripple")
    (gain,) = terms_of("force_ripple", values).gains
    ports = ports_of("force_ripple", values)
    np.testing.assert_allclose(gain(ports.positions), ports.position_gain, rtol=1e-12)


def test_a_gain_from_a_table():
    values = {"position": (-0.1, 0.0, 0.08), "factor": (1.0, 0.9, 1.05)}
    (gain,) = terms_of("motor_gain_table", values).gains
    ports = ports_of("motor_gain_table", values)
    np.testing.assert_allclose(gain(ports.positions), ports.position_gain, rtol=1e-12)
    np.testing.assert_allclose(gain(np.array([-0.2, 0.2])), [1.0, 1.05])


@pytest.mark.parametrize("name", ["friction_position", "friction_spot", "friction_map"])
def test_coulomb_force_over_the_table(name):
    values = drawn(name)
    if name == "friction_spot":
        values |= {"center": 0.01, "other": -0.02}
    ports, terms = ports_of(name, values), terms_of(name, values)
    assert terms.has_coulomb_factor
    factor = coulomb_factor(terms, X, Y, np.zeros(len(X)))
    if ports.position_coulomb is not None:
        expected = np.interp(X, ports.positions, ports.position_coulomb)
    else:
        (field,) = ports.fields
        i = np.clip(np.searchsorted(field.own, X) - 1, 0, None)
        j = np.clip(np.searchsorted(field.other, Y) - 1, 0, None)
        u = (X - field.own[i]) / (field.own[1] - field.own[0])
        w = (Y - field.other[j]) / (field.other[1] - field.other[0])
        corners = (field.values[i + a, j + b] for a in (0, 1) for b in (0, 1))
        shares = ((1 - u) * (1 - w), (1 - u) * w, u * (1 - w), u * w)
        expected = sum(v * s for v, s in zip(corners, shares, strict=True))
    assert np.ptp(expected) > 0.02
    np.testing.assert_allclose(factor, expected, atol=6e-3)


def test_coulomb_force_in_time_and_by_direction():
    values = {"amplitude": 0.3, "time_constant": 20.0}
    terms = terms_of("thermal_drift", values)
    time = np.array([0.0, 20.0, 1e4])
    place = np.zeros(3)
    np.testing.assert_allclose(
        coulomb_factor(terms, place, place, time), [1.3, 1.0 + 0.3 / math.e, 1.0]
    )
    inverses.friction_asymmetry(terms, {"ratio": 0.1})
    late = np.full(3, 1e4)
    heading = np.array([1.0, -1.0, 0.0])
    np.testing.assert_allclose(coulomb_factor(terms, place, place, late, heading), [1.1, 0.9, 1.0])
    ports = ports_of("friction_asymmetry", {"ratio": 0.1})
    assert (ports.coulomb_forward, ports.coulomb_backward) == (terms.forward, terms.backward)


def test_tables_over_position_and_velocity():
    values = {
        "position": (-0.1, 0.0, 0.08),
        "force": (1.0, -2.0, 0.5),
        "coulomb": (1.0, 1.4, 0.7),
        "velocity": (-0.5, 0.0, 0.4),
        "velocity_force": (-3.0, 0.0, 1.0),
    }
    ports, terms = ports_of("residual_table", values), terms_of("residual_table", values)
    assert terms.has_forces
    (force,), (drag,) = terms.forces, terms.velocity_forces
    np.testing.assert_allclose(force(X), [ports.standing_force(x) for x in X], atol=2e-3)
    np.testing.assert_allclose(drag(ports.velocities), ports.velocity_force, atol=1e-12)
    factor = coulomb_factor(terms, X, Y, np.zeros(len(X)))
    expected = np.interp(X, ports.positions, ports.position_coulomb)
    np.testing.assert_allclose(factor, expected, atol=1e-3)
    held = coulomb_factor(terms, np.array([-0.2, 0.2]), np.zeros(2), np.zeros(2))
    np.testing.assert_allclose(held, [1.0, 0.7])
    level = terms_of("residual_table", values | {"coulomb": (1.0, 1.0, 1.0)})
    assert not level.has_coulomb_factor


@pytest.mark.parametrize("name", ["low_speed_friction", "viscous_asymmetry"])
def test_friction_over_velocity_goes_with_the_figures(name):
    values = drawn(name)
    ports, terms = ports_of(name, values), terms_of(name, values)
    assert terms.has_forces
    (force,) = terms.friction_forces
    figures = load_machine().axes["x"].plant.friction.figures
    np.testing.assert_allclose(force(ports.velocities, figures), ports.velocity_force, atol=1e-12)
    twice = force(ports.velocities, figures.scaled(2.0))
    np.testing.assert_allclose(twice, 2.0 * ports.velocity_force, atol=1e-12)


def test_figures():
    terms = KnownTerms()
    for name, key in (
        ("coulomb_level", "coulomb"),
        ("viscous_damping", "viscous"),
        ("presliding_stiffness", "stiffness"),
    ):
        ports = ports_of(name, {"ratio": 1.3})
        getattr(inverses, name)(terms, {"ratio": 1.3})
        figures = known_figures(terms, AXIS.friction)
        theirs = {"coulomb": AXIS.friction.coulomb * ports.coulomb}
        expected = theirs.get(key, getattr(ports, key, 0.0))
        assert getattr(figures, key) == pytest.approx(expected)
    inverses.stribeck(terms, {"static_ratio": 0.9})
    figures = known_figures(terms, AXIS.friction)
    assert figures.static_ratio == 0.9
    assert figures.relaxation_rate == AXIS.friction.relaxation_rate


def test_drive_and_mass():
    terms, ports = KnownTerms(), EffectPorts(AXIS, 1e-3, 1.0)
    for name in (
        "payload_mass", "current_bandwidth", "dead_time", "force_constant", "force_saturation",
        "cross_coupling", "cable_hysteresis", "base_motion",
    ):  # fmt: skip
        values = drawn(name)
        getattr(inverses, name)(terms, values)
        EFFECTS[name].at(**values).apply(ports)
    assert AXIS.mass + terms.mass == pytest.approx(ports.mass)
    assert (terms.bandwidth, terms.delay) == (ports.current_bandwidth, ports.delay)
    assert (terms.gain, terms.saturation) == (ports.force_constant, ports.saturation)
    assert (terms.coupled_mass, terms.hysteresis) == (ports.coupled_mass, ports.hysteresis)
    ((ratio, frequency, damping),) = ports.bases
    assert tuple(terms.bases[0]) == (ratio, frequency, damping)
    assert terms.has_forces
    assert terms.has_motor_factor


def as_in_the_format(own, other):
    """docs/formats/effects.md, "The field of friction_map", at one point after the other."""
    generator = np.random.default_rng([0x4D4150, SEED])
    k = generator.normal(0.0, 1.0 / LENGTH, (2, 300))
    phase = generator.uniform(0.0, 2.0 * np.pi, 300)
    found = []
    for x, y in np.broadcast(own, other):
        normal = math.sqrt(2.0 / 300) * sum(np.cos(k[0] * x + k[1] * y + phase))
        found.append(1.0 + AMPLITUDE * math.erf(normal / math.sqrt(2.0)))
    return np.array(found)


@pytest.fixture
def factor():
    return inverses.random_field(AMPLITUDE, LENGTH, SEED)


def test_at_a_few_points_it_is_exact(factor):
    own, other = np.array([-0.1, 0.02, 0.13]), np.array([0.05, -0.07, 0.0])
    np.testing.assert_allclose(factor(own, other), as_in_the_format(own, other), atol=1e-12)


def test_along_a_dense_path_it_is_as_close_as_its_length_allows(factor):
    own = np.linspace(-0.1, 0.1, 400)
    other = 0.05 * np.sin(20.0 * own)
    expected = as_in_the_format(own, other)
    assert np.ptp(expected) > 0.1
    np.testing.assert_allclose(factor(own, other), expected, atol=2e-4)


def test_a_path_that_stands_still_has_one_value(factor):
    there = factor(np.full(50, 0.03), np.full(50, -0.02))
    np.testing.assert_allclose(there, as_in_the_format(0.03, -0.02)[0], atol=1e-12)
    assert factor(0.03, -0.02).shape == (1,)
