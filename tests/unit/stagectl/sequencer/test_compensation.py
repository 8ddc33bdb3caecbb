"""Force offsets in every mode, and their continuity from move to move."""

import numpy as np
import pytest

from estimation.move import MoveData
from estimation.trajectory import Limits, plan
from stagectl.config import load_machine, parse_machine
from stagectl.sequencer import Mode, make_compensation

TS = 1e-3
MOVE = plan(0.0, 25e-3, Limits(0.5, 3.0, 200.0))


def offsets(compensation, rest_force=0.0, rest_offset=0.0):
    return compensation.force_offsets(MOVE, 260, 0.1, 0.0, rest_force, rest_offset)


def test_mode_none_is_mass_times_acceleration():
    x, _ = make_compensation(load_machine(), Mode.NONE)
    ahead = 1 / (2 * np.pi * 1500.0) + 0.5e-4
    expected = 8.0 * MOVE.sample(np.arange(1, 261) * TS + ahead)[2]
    np.testing.assert_allclose(offsets(x), expected, atol=1e-12)
    assert x.learn(MoveData(np.zeros(5), np.zeros(5), np.ones(5, bool), 0.0, 0.0)) is None


def test_mode_model_adds_friction_of_the_machine_file():
    none, model = (make_compensation(load_machine(), m)[0] for m in (Mode.NONE, Mode.MODEL))
    friction = offsets(model) - offsets(none)
    middle = slice(80, 120)
    speed = MOVE.sample(np.arange(1, 261) * TS)[1]
    assert friction[middle] == pytest.approx(6.0 + 20.0 * speed[middle], abs=0.1)


def test_long_moves_take_over_what_the_integrator_holds():
    x, _ = make_compensation(load_machine(), Mode.MODEL)
    plain = offsets(x, rest_force=2.0, rest_offset=2.0)
    x, _ = make_compensation(load_machine(), Mode.MODEL)
    behind = offsets(x, rest_force=2.0, rest_offset=1.0)
    assert behind[0] == pytest.approx(plain[0] - 1.0, abs=1e-3)
    assert behind[-1] == pytest.approx(plain[-1], abs=1e-9)


def test_scale_applies_to_the_machine_file_and_not_to_the_truth():
    machine = load_machine()
    half, _ = make_compensation(machine, Mode.ESTIMATED, 0.5)
    assert half.estimator.friction.coulomb == 3.0
    text = machine.text.replace("coulomb: 6.0", "coulomb: 7.5")
    truth = parse_machine(text, "truth")
    oracle, _ = make_compensation(machine, Mode.ORACLE, 1.0, truth)
    assert oracle.estimator.friction.coulomb == 7.5
    assert truth.axes["x"].plant.friction.figures.attraction == pytest.approx(600.0)


def test_only_mode_estimated_reports_estimates():
    position = MOVE.sample(np.arange(300) * TS)[0]
    data = MoveData(position, np.full(300, 6.0), np.ones(300, dtype=bool), 0.0, 0.0)
    model, _ = make_compensation(load_machine(), Mode.MODEL)
    before = model.estimator.friction
    assert model.learn(data) is None
    assert model.estimator.friction == before
    estimated, _ = make_compensation(load_machine(), Mode.ESTIMATED)
    learned = estimated.learn(data)
    assert learned is not None
    assert learned.compute_time > 0


def test_a_correction_at_the_same_place_keeps_the_forces_of_the_elements():
    """Another Coulomb force elsewhere scales them."""
    for better in (False, True):
        x, _ = make_compensation(load_machine(), Mode.ESTIMATED)
        offsets(x, rest_force=3.0)
        before = x.estimator.state.forces.copy()
        (x.correct_at_place if better else x.expect_at_target)(7.5, 0.05, (0.004, 0.005))
        friction = x.estimator.friction
        assert friction.coulomb == pytest.approx(7.5)
        assert x.estimator.level == pytest.approx(1.004)
        scale = 1.0 if better else 7.5 / 6.0
        np.testing.assert_allclose(x.estimator.state.forces, scale * before)
