"""Force offsets in every mode, and their continuity from move to move."""

import numpy as np
import pytest

from estimation.move import MoveData
from estimation.trajectory import Limits, plan
from stagectl.config import load_machine, parse_machine
from stagectl.sequencer import Mode, make_compensation
from stagectl.sequencer.compensation.axis_compensation import AtRest, AxisMotion
from stagectl.sequencer.compensation.places import Expectation
from tests.unit.stagectl.machines import with_effects

TS = 1e-3
MOVE = plan(0.0, 25e-3, Limits(0.5, 3.0, 200.0))


def offsets(compensation, rest_force=0.0, rest_offset=0.0, variation=None):
    demand = AxisMotion(MOVE, None, 260, variation)
    return compensation.force_offsets(demand, AtRest(0.1, 0.0, rest_force, rest_offset))


def test_mode_none_is_mass_times_acceleration():
    x, _ = make_compensation(load_machine(), Mode.NONE)
    time = np.arange(1, 261) * TS
    corners = np.append(MOVE.start, MOVE.duration)
    smooth = np.abs(time[:, None] - corners).min(axis=1) > 4e-3
    ahead = 1 / (2 * np.pi * 1500.0) + 0.5e-4
    _, speed, acceleration = MOVE.sample(time)
    jerk = MOVE.jerk[np.searchsorted(MOVE.start, time, "right") - 1] * (time < MOVE.duration)
    chord = 341e3 * acceleration + 16.07e6 * speed + 2714.0 * jerk
    expected = 8.0 * MOVE.sample(time + ahead)[2] - chord * (TS**2 - 1e-8) / 12.0
    np.testing.assert_allclose(offsets(x)[smooth], expected[smooth], atol=1e-9)
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
    assert learned.compute_time > 0


def test_a_correction_at_the_same_place_keeps_the_forces_of_the_elements():
    """Another Coulomb force elsewhere scales them."""
    for better in (False, True):
        x, _ = make_compensation(load_machine(), Mode.ESTIMATED)
        offsets(x, rest_force=3.0)
        before = x.estimator.state.forces.copy()
        (x.correct_at_place if better else x.expect_at_target)(
            Expectation(7.5, 0.05, (0.004, 0.005))
        )
        friction = x.estimator.friction
        assert friction.coulomb == pytest.approx(7.5)
        assert x.estimator.level == pytest.approx(1.004)
        scale = 1.0 if better else 7.5 / 6.0
        np.testing.assert_allclose(x.estimator.state.forces, scale * before)


def known_offsets(machine, mode=Mode.MODEL):
    x, y = make_compensation(machine, mode)
    assert y.known is None
    if x.known is None:
        return offsets(x)
    time = np.arange(1, 261) * TS
    demand = np.column_stack([MOVE.sample(time)[0], np.zeros(260)])
    x.begin_known(AxisMotion(MOVE, None, 260), demand, 0.1)
    return offsets(x, variation=x.known.variation(None, demand, time))


def test_a_known_force_is_added_along_the_way():
    cable = with_effects("effect: cable_stiffness, stiffness: 40, center: 0")
    ahead = 1 / (2 * np.pi * 1500.0) + 0.5e-4
    there = MOVE.sample(np.arange(1, 261) * TS + ahead)[0]
    change = known_offsets(cable) - known_offsets(load_machine())
    np.testing.assert_allclose(change, 40.0 * there, atol=1e-6)


def test_mass_friction_figures_and_lead_are_those_that_are_known():
    known = with_effects(
        "effect: payload_mass, mass: 1.0", "effect: coulomb_level, ratio: 1.2",
        "effect: dead_time, delay: 0.001",
    )  # fmt: skip
    x, _ = make_compensation(known, Mode.ESTIMATED, 0.5)
    assert x.estimator.friction.coulomb == pytest.approx(3.6)
    assert x.estimator.settings.mass == 9.0
    text = load_machine().text
    for old, new in (("mass: 8.0", "mass: 9.0"), ("n: 600.0", "n: 720.0"), ("b: 6.0", "b: 7.2")):
        text = text.replace(old, new)
    changed = known_offsets(parse_machine(text, "changed"))
    # A dead time of one period: the same force one setpoint earlier, but for the beginning.
    np.testing.assert_allclose(known_offsets(known)[2:-1], changed[3:], atol=0.03)


def test_without_compensation_effects_change_nothing():
    heavier = with_effects("effect: payload_mass, mass: 1.0")
    plain, known = (known_offsets(m, Mode.NONE) for m in (load_machine(), heavier))
    np.testing.assert_array_equal(plain, known)


def test_friction_where_the_force_is_known_to_be_higher_is_fed_forward_as_such():
    bump = with_effects("effect: friction_position, amplitude: 0.5, center: 0.025, width: 0.005")
    change = known_offsets(bump) - known_offsets(load_machine())
    place = MOVE.sample(np.arange(1, 261) * TS)[0]
    level = 3.0 * np.exp(-0.5 * ((place - 0.025) / 0.005) ** 2)
    expected = np.zeros(260)
    for k in range(1, 260):  # what slides follows with C/Fc = 100 1/s
        expected[k] = level[k] + (expected[k - 1] - level[k]) * np.exp(-100.0 * TS)
    assert expected[130] > 0.8
    np.testing.assert_allclose(change[60:131], expected[60:131], atol=0.05)
