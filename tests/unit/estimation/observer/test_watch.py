"""The observer watched: what it feeds is cut off, what comes from elsewhere is not, no wind-up."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

from estimation.observer import BusUnits, Carriage, Finding, Kind, StageObserver, design_observer
from estimation.observer.kernel import NOW_DTYPE
from estimation.observer.watch import (
    ELSEWHERE,
    FED,
    FIGURES_DTYPE,
    SUSPECTED,
    WATCH_DTYPE,
    WATCHING,
    watch,
)
from tests.unit.estimation.observer.axes import CARRIAGE, DRIVE, FIGURES, PERIOD, Plant

DESIGN = design_observer(FIGURES)
UNITS = BusUnits(1e-9, 0.04, 120.0)
SLIDING = Carriage(8.0, 0.0, 20.0)
WEAK = replace(DRIVE, kp=0.4 * DRIVE.kp, ki=0.4 * DRIVE.ki, kd=0.4 * DRIVE.kd)
STEP = 1e-9
VISIBLE = 100e-9
"""Deviations above this, high-passed or not, are an oscillation here [m]."""


class Course(NamedTuple):
    """One value per SYNC, shape (K,), and all findings."""

    deviation: np.ndarray
    correction: np.ndarray
    findings: list[Finding]
    observer: StageObserver


def run(
    pushes,
    plant=None,
    speed=0.0,
    late=0.0,
    noise=1e-9,
    observer=None,
    sign=1,
):
    """An axis under its observer that moves at a constant speed, with samples that may be late.

    Args:
        pushes: force against the motion in each period [N], shape (K,).
        plant: as `FIGURES` says if None.
        speed: of the demand [m/s].
        late: time by which a sampled position is old [s].
        noise: of the encoder [m rms].
        observer: None: a new one.
        sign: with which the offset acts.
    """
    plant, rows = plant or Plant(), len(pushes)
    observer = observer or StageObserver([DESIGN], [UNITS], PERIOD, 1e-4)
    path = np.rint(speed * PERIOD / STEP * np.arange(1, rows + 1)).astype(np.int64)[:, None]
    observer.begin(path, np.zeros((rows, 1)), [0], False)
    deviation, correction = np.zeros(rows), np.zeros(rows)
    wiggle = np.random.default_rng(1).normal(0.0, noise, (rows, 10))
    before, findings, force = 0.0, [], 0
    for k in range(rows):
        reached = speed * PERIOD * (k - 1 + 0.1) if k else 0.0
        reading = reached + plant.deviation + wiggle[k, 0] - speed * late
        observer.sample[0] = (round(reading / STEP), force, 1, 0)
        sent = observer.offsets(k, 1, 0.0)[0] * UNITS.force
        deviation[k], correction[k] = plant.deviation, observer.correction[0]
        plant.advance(sign * before, sign * sent, pushes[k], wiggle[k], steps=10)
        before, force = sent, round(plant.force / UNITS.force)
        findings += observer.findings()
    return Course(deviation, correction, findings, observer)


def kinds(course):
    return [found.kind for found in course.findings]


def test_an_oscillation_that_it_feeds_is_cut_off_and_stays_out():
    course = run(np.full(900, 0.3), Plant(WEAK, SLIDING))
    assert kinds(course) == [Kind.SUSPECTED, Kind.FED]
    fed = course.findings[-1]
    frozen = round(fed.time / PERIOD)
    onset = int(np.argmax(np.abs(course.deviation[40:]) > VISIBLE)) + 40  # after the push itself
    assert frozen - onset <= 300
    assert 25.0 < fed.frequency < 60.0
    assert np.abs(course.deviation[-200:]).max() < 30e-9
    rates = np.abs(np.diff(course.correction[frozen:])) / PERIOD
    assert rates.max() <= 0.5
    assert rates.max() <= 1.01 * DRIVE.ki * 5e-9
    assert course.observer.out == (True,)
    course.observer.restart()
    assert course.observer.out == (True,)
    again = run(np.full(300, 0.3), Plant(WEAK, SLIDING), observer=course.observer)
    assert np.abs(again.correction).max() == 0.0
    assert again.findings == []


@pytest.mark.parametrize("frequency", [27.0, 33.0, 51.0, 120.0])
def test_a_vibration_from_elsewhere_is_told_and_the_observer_returns(frequency):
    pushes = 3.0 * np.sin(2.0 * np.pi * frequency * PERIOD * np.arange(1500))
    course = run(pushes)
    assert kinds(course) == [Kind.SUSPECTED, Kind.ELSEWHERE]
    assert course.findings[-1].frequency == pytest.approx(frequency, rel=0.25)
    assert course.observer.out == (False,)
    step = np.abs(np.diff(course.correction)).max()
    told = round(course.findings[-1].time / PERIOD)
    assert np.abs(np.diff(course.correction[told + 3 :])).max() <= step  # it returns as it acts
    assert course.correction[-300:].std() > 0.0


@pytest.mark.parametrize("frequency", [5.0, 12.0, 18.0])
def test_a_slow_vibration_does_not_take_the_observer_out(frequency):
    course = run(2.0 * np.sin(2.0 * np.pi * frequency * PERIOD * np.arange(900)))
    assert np.abs(course.deviation[300:]).max() > VISIBLE
    assert kinds(course)[-1:] in ([], [Kind.ELSEWHERE])
    assert course.observer.out == (False,)


@pytest.mark.parametrize("carriage", [CARRIAGE, SLIDING])
def test_pushes_and_noise_are_no_alarm(carriage):
    """Half of Fc either way, three times a second, some at once and some slowly."""
    steps = np.repeat(np.random.default_rng(3).uniform(-3.0, 3.0, 6), 300)
    slow = np.convolve(steps, np.full(60, 1 / 60), "same")
    for pushes in (steps, slow):
        assert run(pushes, Plant(DRIVE, carriage)).findings == []


@pytest.mark.parametrize("carriage", [CARRIAGE, SLIDING, replace(SLIDING, mass=14.0)])
def test_a_deviation_that_the_correction_drives_is_cut_off_as_it_grows(carriage):
    """The offset acts with the wrong sign: what should bring a push's deviation back adds to it."""
    course = run(np.full(900, 0.3), Plant(DRIVE, carriage), sign=-1)
    assert kinds(course) == [Kind.GROWS]
    onset = int(np.argmax(np.abs(course.deviation[40:]) > VISIBLE)) + 40
    assert course.findings[0].time / PERIOD - onset <= 300
    assert course.findings[0].rms < 6e-6
    assert np.abs(course.deviation[-200:]).max() < 50e-9
    assert course.observer.out == (True,)


@pytest.mark.parametrize(("late", "kind"), [(1e-3, Kind.STANDS), (0.3e-3, Kind.GROWS)])
def test_an_old_position_is_noticed_before_it_winds_up(late, kind):
    course = run(np.full(600, 6.0), Plant(DRIVE, SLIDING), speed=10e-3, late=late)
    assert kinds(course) == [kind]
    assert course.findings[0].time <= 0.3
    assert course.findings[0].rms <= 1.1 * 10e-3 * late


def test_a_drive_that_does_not_answer_is_noticed_in_any_motion():
    course = run(np.full(200, 6.0), Plant(DRIVE, SLIDING), speed=0.2, late=1e-3)
    assert kinds(course) in ([Kind.UNANSWERED], [Kind.GROWS])


def test_the_correction_is_bounded_by_friction_and_acceleration():
    observer = StageObserver([DESIGN], [UNITS], PERIOD, 1e-4)
    assert np.abs(run(np.full(300, 15.0), observer=observer).correction).max() <= 6.0
    observer.bound(0, 9.0)
    assert np.abs(run(np.full(300, 15.0), observer=observer).correction).max() > 8.9


def test_what_acts_at_rest_leaks_into_the_integrator_within_5_nm():
    leaking = run(np.full(3000, 5.5), noise=0.0)
    assert abs(leaking.deviation[-1000:].mean()) <= 5e-9
    assert leaking.correction[600] - leaking.correction[-1] > 0.05


BLOCK = 25
"""Samples of a block, in the tests of signals."""
UNAVOIDABLE = 40e-9
"""[m rms]"""


def found_in(deviation, unsteady=(), opened=0.0):
    """Findings of the watchdog, in order, on a deviation that the observer has no part in.

    Args:
        deviation: at each SYNC [m], shape (K,).
        unsteady: when a demand accelerates.
        opened: factor on the deviation while the correction is frozen: 0: the observer fed it.
    """
    figures, watched, now = (
        np.zeros(1, kind)[0] for kind in (FIGURES_DTYPE, WATCH_DTYPE, NOW_DTYPE)
    )
    figures["block"], figures["high_pass"], figures["kp"] = BLOCK, 0.93, 1e6
    figures["floor"] = UNAVOIDABLE**2
    found = []
    for k, value in enumerate(deviation):
        own = value if watched["mode"] == WATCHING else opened * value
        before = int(watched["findings"])
        watch(figures, watched, now, own, 0.0, 0.0, 6.0, not any(k in u for u in unsteady), False)
        found += [int(watched["finding"])] * (int(watched["findings"]) - before)
    return found


def waves(amplitude, frequency=45.0):
    """An oscillation [m] of this amplitude [m], shape (K,)."""
    return amplitude * np.sin(2.0 * np.pi * frequency * PERIOD * np.arange(len(amplitude)))


WAXING = 1e-6 * np.repeat([1.0, 0.3, 0.7, 0.2, 1.0, 0.3, 0.8, 0.3, 1.0, 0.3, 1.0, 1.0], 2 * BLOCK)


def test_an_oscillation_that_waxes_and_wanes_by_friction_is_found():
    assert found_in(waves(WAXING)) == [SUSPECTED, FED]
    assert found_in(waves(WAXING), opened=1.0) == [SUSPECTED, ELSEWHERE]


def test_moves_neither_end_a_suspicion_nor_an_experiment():
    """Three blocks between two moves: the first is not judged, four are to be of too much power."""
    moves = [range(k, k + 40) for k in range(3 * BLOCK, 1200, 40 + 3 * BLOCK)]
    lasting = waves(np.full(1200, 1e-6))
    assert found_in(lasting, moves) == [SUSPECTED, FED]
    assert found_in(lasting, moves, opened=0.9) == [SUSPECTED, ELSEWHERE]


def test_what_is_neither_gone_nor_as_before_without_the_observer_was_fed():
    assert found_in(waves(np.full(1200, 1e-6)), opened=0.6) == [SUSPECTED, FED]


def test_a_quiet_block_ends_a_suspicion():
    bursts = 1e-6 * np.tile(np.repeat([1.0, 0.0], 3 * BLOCK), 6)
    assert found_in(waves(bursts)) == []


@pytest.mark.parametrize("frequency", [15.0, 45.0, 250.0])
def test_what_a_push_leaves_is_not_suspected(frequency):
    """It loses half of its power in a block."""
    dying = 10e-6 * 0.6 ** (np.arange(600) % 300 / BLOCK)
    assert found_in(waves(dying, frequency)) == []


def test_slow_waves_of_the_rounded_offset_are_not_suspected():
    small = np.full(2000, 3.5 * UNAVOIDABLE)
    assert found_in(waves(small, 19.0)) == []
    assert found_in(waves(small, 80.0)) == [SUSPECTED, FED]
