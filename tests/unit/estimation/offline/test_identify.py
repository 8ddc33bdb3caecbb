"""Off-line identification on the independent simulation (16 elements, its own integrator)."""

from dataclasses import replace

import numpy as np
import pytest

from estimation.noise import encoder_noise, quantisation
from estimation.offline import OfflineSettings, Samples, identify
from estimation.offline.uncertainty import BOUND, ESTIMATED, PRIOR
from estimation.trajectory import Limits, plan
from hil_sim.effects.library import own_effects
from hil_sim.plant import Slip, simulate, slip_step, stribeck
from stagectl.config import load_machine, stage_settings
from stagedata import FrictionFigures

TS, MASS = 1e-3, 8.0
MACRO, MICRO = Limits(0.5, 3.0, 200.0), Limits(0.01, 0.2, 20.0)
BELIEVED = FrictionFigures(4, 6.0, 20.0, 6e5, 100.0, 0.4, 2e-3, 1.0)
SETTINGS = OfflineSettings(
    mass=MASS, period=TS, position_noise=encoder_noise(1e-9, 1e-9), force_noise=quantisation(0.04)
)


def drive(macro=6, micro=2, seed=1, effects=(), **friction):
    """Closed loop, axis x with 16 elements: macro-moves, each with micro-moves behind it."""
    stage = stage_settings(load_machine())
    x = stage.axes[0]
    truth = x.friction.with_figures({"elements": 16, **friction})
    stage = replace(stage, axes=(replace(x, friction=truth, effects=effects),))
    rng = np.random.default_rng(seed)
    at, demand, offset = 0.0, [np.zeros(60)], [np.zeros(60)]
    for number in range(macro * (1 + micro)):
        first = number % (1 + micro) == 0
        way = rng.choice([-1.0, 1.0])
        target = rng.uniform(-0.01, 0.01) if first else at + way * rng.uniform(3e-5, 8e-5)
        motion = plan(at, target, MACRO if first else MICRO)
        rows = int(motion.duration / TS) + 80
        position, _, acceleration = motion.sample(np.arange(1, rows + 1) * TS)
        demand.append(position)
        offset.append(MASS * acceleration)
        at = target
    sent = np.concatenate(demand)
    response = simulate(stage, sent[:, None], np.concatenate(offset)[:, None], seed)
    ones = np.ones(len(sent), dtype=bool)
    return Samples(response.position[:, 0], response.force[:, 0], ones, 0.0, sent)


@pytest.fixture(scope="module")
def other_stribeck():
    lopsided = own_effects()["friction_asymmetry"].at(ratio=0.08)
    samples = drive(8, effects=(lopsided,), static_ratio=0.65, stribeck_velocity=3e-3, viscous=26.0)
    return identify(
        [samples],
        replace(BELIEVED, elements=6),
        SETTINGS,
    )


def test_finds_stribeck_curve_and_all_else_that_differs(other_stribeck):
    found = other_stribeck
    assert found.reason is None
    truth = {"static_ratio": 0.65, "stribeck_velocity": 3e-3, "viscous": 26.0, "coulomb": 6.0}
    for name, value in truth.items():
        assert found[name].verdict == ESTIMATED
        assert found[name].value == pytest.approx(value, rel=0.06), name
    assert found["stribeck_shape"].value == pytest.approx(1.0, abs=0.15)
    assert found["stiffness"].value == pytest.approx(6e5, rel=0.06)
    assert found["asymmetry"].value == pytest.approx(0.08, abs=0.02)
    # Nothing of these was in the truth.
    assert abs(found["force_offset"].value) < 0.2
    assert abs(found["lag"].value) < 0.05e-3


def test_it_explains_what_the_figures_before_did_not_also_on_moves_held_out(other_stribeck):
    assert other_stribeck.before > 2.0 * other_stribeck.misfit
    assert other_stribeck.held_out < 1.3 * other_stribeck.misfit


def test_shape_adds_to_one_and_sixteen_elements_are_not_six(other_stribeck):
    for prefix in ("k_", "nu_"):
        values = [f.value for f in other_stribeck.figures if f.name.startswith(prefix)]
        assert sum(values) == pytest.approx(1.0)
        assert min(values) > 0.0
    # Six elements in place of sixteen: the first ones are stiffer and break away sooner.
    assert other_stribeck["k_1"].value > 1.0 / 6.0


def open_loop(shares, asymmetry, seed=3):
    """The simulator's elements led along a demand in steps of 50 us; no loop, no wander."""
    rng = np.random.default_rng(seed)
    at, pieces = 0.0, [np.zeros(1000)]
    for number in range(21):
        target = rng.uniform(-3e-3, 3e-3) if number % 3 == 0 else at + rng.choice([-7e-5, 7e-5])
        motion = plan(at, target, Limits(0.2, 1.0, 20.0) if number % 3 == 0 else MICRO)
        time = np.arange(1, int(motion.duration / 5e-5) + 600) * 5e-5
        pieces.append(motion.sample(time)[0])
        at = target
    x = np.concatenate(pieces)
    count = len(shares)
    forces, slipping, heading = np.zeros(count), np.zeros(count, dtype=bool), 0.0
    friction = np.zeros(len(x))
    for k in range(1, len(x)):
        dx = x[k] - x[k - 1]
        if dx != 0.0:
            if np.sign(dx) != heading:
                heading = float(np.sign(dx))
                slipping[:] = False
            curve = stribeck(dx / 5e-5, 0.4, 2e-3, 1.0)
            level = 6.0 * (1 + asymmetry * heading) * curve
            slip = Slip(heading, dx, level, np.exp(-100.0 * 5e-5 / curve))
            friction[k] = slip_step(forces, slipping, shares, slip, 6e5 / count, count)
        else:
            friction[k] = friction[k - 1]
    v, a = np.gradient(x, 5e-5), np.gradient(np.gradient(x, 5e-5), 5e-5)
    force = (MASS * a + 20.0 * v + friction)[::20]
    position = x[::20] + rng.normal(0.0, 1e-9, len(force))
    force = np.round(force / 0.04) * 0.04
    return Samples(position, force, np.ones(len(force), dtype=bool), 0.0)


def test_shape_and_asymmetry_of_another_hysteresis():
    # k_i = 1/4, nu_i equal: an elastic, ideally plastic solid with four break points in one.
    shares = np.array([0.2, 0.22, 0.28, 0.3])
    found = identify([open_loop(shares, 0.1)], BELIEVED, replace(SETTINGS, wander=1e-4))
    assert found.reason is None
    total = found["asymmetry"].value * found["coulomb"].value + found["force_offset"].value
    assert total == pytest.approx(0.6, abs=0.03)
    assert found["asymmetry"].value == pytest.approx(0.1, abs=5 * found["asymmetry"].sigma + 0.01)
    # The curve of the forces, not each element: neighbours may stand for one another.
    travel = np.linspace(0.0, 30e-6, 50)

    def curve(stiffness, springs, limits):
        return np.minimum(np.outer(travel, stiffness * springs), 6.0 * limits).sum(axis=1)

    springs = np.array([found[f"k_{i}"].value for i in range(1, 5)])
    limits = np.array([found[f"nu_{i}"].value for i in range(1, 5)])
    truth = curve(6e5, np.full(4, 0.25), shares)
    believed = curve(6e5, np.full(4, 0.25), np.array([0.1, 0.2, 0.3, 0.4]))
    error = np.abs(curve(found["stiffness"].value, springs, limits) - truth).max()
    assert error < 0.25 * np.abs(believed - truth).max()


def test_what_the_moves_do_not_tell_stays_at_its_prior():
    # One long move: no reversal and no low speed after all elements slip.
    samples = drive(macro=3, micro=0)
    far = np.flatnonzero(np.abs(samples.position - samples.position[0]) > 1e-4)[0]
    cut = slice(0, far + 90)
    piece = Samples(
        samples.position[cut], samples.force[cut], samples.valid[cut], 0.0, samples.demand[cut]
    )
    found = identify([piece], BELIEVED, replace(SETTINGS, least=50))
    assert found.reason is None
    stayed = [f for f in found.figures if f.verdict == PRIOR]
    assert {"stiffness", "k_1", "nu_4", "asymmetry"} <= {f.name for f in stayed}
    for figure in stayed:
        assert figure.gain == 1.0
        assert figure.value == pytest.approx(figure.prior)
        assert figure.sigma == pytest.approx(figure.prior_sigma)
    assert found["coulomb"].verdict == ESTIMATED


class TestRefusals:
    def test_rest_tells_nothing(self):
        still = Samples(np.zeros(500), np.ones(500), np.ones(500, dtype=bool), 0.0)
        found = identify([still], BELIEVED, SETTINGS)
        assert "samples in motion" in str(found.reason)
        assert all(f.value == f.prior for f in found.figures)

    def test_a_force_that_no_friction_explains(self):
        samples = drive(macro=3, micro=1)
        noise = np.random.default_rng(0).normal(0.0, 3.0, len(samples.force))
        found = identify([replace(samples, force=samples.force + noise)], BELIEVED, SETTINGS)
        assert "residual" in str(found.reason)
        assert all(f.verdict == PRIOR for f in found.figures)

    def test_no_moves(self):
        with pytest.raises(ValueError, match="no moves"):
            identify([], BELIEVED, SETTINGS)

    def test_a_figure_on_its_bound_is_not_an_estimate(self):
        samples = drive(macro=3, micro=1)
        # Twelve times the Coulomb force that is believed: beyond its bound.
        low = replace(BELIEVED, coulomb=0.5, relaxation_rate=100.0, stiffness=6e5)
        found = identify([samples], low, replace(SETTINGS, misfit=1e9))
        assert found["coulomb"].verdict in (BOUND, PRIOR)
        assert found["coulomb"].value == found["coulomb"].prior


def test_missing_samples_do_no_harm():
    samples = drive(macro=4)
    clean = identify([samples], BELIEVED, SETTINGS)
    rng = np.random.default_rng(2)
    valid = rng.random(len(samples.valid)) > 0.01
    valid[900:920] = False  # a hole: the state of the elements is unknown after it
    spoiled = np.where(valid, samples.force, 99.0)
    holed = identify([replace(samples, valid=valid, force=spoiled)], BELIEVED, SETTINGS)
    assert holed.reason is None
    assert holed.samples < clean.samples
    for name in ("coulomb", "stiffness", "static_ratio"):
        assert holed[name].value == pytest.approx(clean[name].value, rel=0.03), name


def test_what_has_not_converged_is_refused(monkeypatch):
    monkeypatch.setattr("estimation.offline.fit.MAX_ITERATIONS", 1)
    start = BELIEVED.scaled(0.6)
    found = identify([drive(macro=3)], start, SETTINGS)
    assert found.reason is not None
    assert found.reason.startswith("no minimum was reached in")
    assert found["coulomb"].value == start.coulomb
    assert found["coulomb"].verdict == PRIOR
