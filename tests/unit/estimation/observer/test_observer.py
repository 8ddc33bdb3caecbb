"""From SYNC to SYNC: what the correction does, and what leaves it as it is."""

from dataclasses import replace

import numpy as np
import pytest

from estimation.observer import (
    BusUnits,
    Carriage,
    StageObserver,
    design_observer,
    without_presliding,
)
from tests.unit.estimation.observer.axes import (
    CARRIAGE,
    FIGURES,
    PERIOD,
    UNITS,
    Plant,
    closed_loop,
)

DESIGN = design_observer(FIGURES)
COARSE = BusUnits(1e-9, 0.04, 120.0)
"""As on a real bus."""


def observer(design=DESIGN, units=COARSE):
    """An observer that has seen its axis at rest, with 200 rows before it."""
    made = StageObserver([design], [units], PERIOD, 1e-4)
    made.begin(np.zeros((200, 1), np.int64), np.zeros((200, 1)), [0], False)
    made.sample[0] = (0, 0, 1, 0)
    made.offsets(0, 1, 0.0)
    return made


def follow(made, positions, **flags):
    """The corrections after samples at these positions [increments]."""
    found = []
    for row, position in enumerate(positions, start=1):
        made.sample[0] = (position, flags.get("force", 0), flags.get("valid", 1), 0)
        made.offsets(row, int(flags.get("periods", 1)), float(flags.get("doubt", 0.0)))
        found.append(made.correction[0])
    return found


@pytest.mark.parametrize("stiffness", [0.0, 3e5, 6e5, 9e5])
def test_what_the_axis_lacks_is_sent(stiffness):
    """A force of 2 N: after 85 ms the offset holds it, not the integrator."""
    plant = Plant(carriage=Carriage(8.0, stiffness, 20.0))
    rows = 150
    deviation, _, offset = closed_loop(DESIGN, np.full(rows, 2.0), np.zeros((rows, 10)), plant)
    assert np.abs(deviation[85:]).max() < 50e-9
    assert offset[-1] + plant.integral == pytest.approx(2.0, rel=0.01)
    assert offset[-1] > 4.0 * abs(plant.integral)


def test_rounding_is_carried_on():
    """The mean of what is sent is what is wanted, though a unit is 40 mN."""
    made = observer()
    made.begin(np.zeros((400, 1), np.int64), np.full((400, 1), 0.3), [0], True)
    sent = [made.offsets(row, 1, 0.0)[0] for row in range(400)]
    lacking = made.correction[0] / COARSE.force
    assert set(sent) <= {-1, 0, 1}
    assert np.mean(sent[-100:]) == pytest.approx(0.3 + lacking, abs=0.05)


def test_the_correction_is_limited():
    made = observer(replace(DESIGN, figures=replace(FIGURES, limit=5.0)))
    assert min(follow(made, [-20_000] * 180)) >= -5.0
    assert max(follow(made, [-20_000] * 180)) == pytest.approx(5.0)


@pytest.mark.parametrize(
    "flags",
    [{"valid": 0}, {"force": 2990}, {"force": -2990}],
    ids=["invalid", "saturated", "saturated the other way"],
)
def test_a_sample_that_says_nothing_changes_nothing(flags):
    made = observer()
    before = follow(made, [0, -10, -20, -20, -20])[-1]
    after = follow(made, [-500] * 5, **flags)
    if "force" in flags:
        assert after == [before] * 5
    else:  # predicted: the correction goes on towards what was lacking before
        reference = observer()
        follow(reference, [0, -10, -20, -20, -20])
        assert after == follow(reference, [900] * 5, valid=0)


@pytest.mark.parametrize(("doubt", "arrival"), [(0.02, 0), (-0.02, 0), (0.0, 20_000)])
def test_samples_off_their_instant_count_only_at_rest(doubt, arrival):
    """SYNC left early or late by 20 us, or its answer came so much later than usual."""
    counts = {}
    for speed in (0, 100_000):  # increments per SYNC
        for off in (False, True):
            found = []
            for position in (0, -400):
                made = observer()
                targets = np.arange(1, 201, dtype=np.int64)[:, None] * speed
                made.begin(targets, np.zeros((200, 1)), [0], True)
                for row in range(6):
                    at = round(max(row - 0.9, 0.0) * speed) + position * (row > 2)
                    now = off and row > 2
                    made.sample[0] = (at, row, row > 0, arrival * now)  # it was moving before
                    made.offsets(row, 1, doubt * now)
                found.append(made.correction[0])
            counts[speed, off] = found[1] - found[0]
    assert counts[0, True] == counts[0, False]
    assert abs(counts[100_000, True]) < 0.01 * abs(counts[100_000, False])


def test_jitter_is_not_a_force():
    """At 0.3 m/s SYNC comes up to 20 us late, unknown to the host but for when answers come."""
    made, speed, rows = observer(), 300_000, 400
    targets = np.arange(1, rows + 1, dtype=np.int64)[:, None] * speed
    made.begin(targets, np.zeros((rows, 1)), [0], True)
    found = []
    for row, late in enumerate(np.random.default_rng(1).integers(0, 20_001, rows).tolist()):
        late -= 10_000 if row else 0
        at = max(row - 0.9, 0.0) * speed + speed * late * 1e-6
        made.sample[0] = (round(at), row, 1, 100_000 + late)
        made.offsets(row, 1, 0.0)
        found.append(made.correction[0])
    assert np.abs(found).max() < 3.0


@pytest.mark.parametrize("jump", [20_000, -50_000])
def test_a_jump_that_no_force_makes_is_not_answered_by_force(jump):
    """The axis is 20 um away for one sample, as after setpoints that did not reach the drive."""
    made = observer()
    assert np.abs(follow(made, [0] * 5 + [jump] + [0] * 20)).max() < 1.0


def test_a_lasting_jump_is_answered():
    assert follow(observer(), [-2_000] * 60)[-1] > 5.0


def test_stale_samples_do_not_count_in_motion():
    made = observer()
    targets = np.arange(1, 201, dtype=np.int64)[:, None] * 1000
    made.begin(targets, np.zeros((200, 1)), [0], True)
    for row in range(20):
        made.sample[0] = (0, 7, row > 0, 0)
        made.offsets(row, 1, 0.0)
    assert abs(made.correction[0]) < 1.0  # 20 um behind, if it were true


def test_periods_that_were_skipped_are_predicted():
    """An axis under a constant push, of which the host misses periods: the same in the end."""
    plant, made = Plant(), observer(units=UNITS)
    before = sent = 0.0
    row = last = 1
    generator = np.random.default_rng(4)
    while row < 199:
        periods = 1 + (generator.random() < 0.1) * 3
        for k in range(periods):  # the pair is reached in the first, then held
            reading = plant.deviation
            plant.advance(before if k == 0 else sent, sent, 2.0, np.zeros(10))
            if k == 0:
                made.sample[0] = (round(reading / UNITS.increment), 0, 1, 0)
        before = sent
        sent = made.offsets(row, last, 0.0)[0] * UNITS.force
        last, row = periods, row + 1
    assert sent + plant.integral == pytest.approx(2.0, rel=0.02)
    assert abs(plant.deviation) < 50e-9


def test_a_value_that_is_not_finite_freezes_the_correction():
    made = observer()
    before = follow(made, [0, -10, -20, -20])[-1]
    made.begin(np.zeros((200, 1), np.int64), np.zeros((200, 1)), [0], True)
    made._state.estimate[0, 1] = np.nan  # noqa: SLF001  no input can bring it about
    assert follow(made, [-500, 300, 10]) == [before] * 3
    assert made.failed == (True,)
    sent = [made.offsets(row, 1, 0.0)[0] for row in range(100)]
    assert np.mean(sent) == pytest.approx(before / COARSE.force, abs=0.02)
    made.restart()
    assert made.failed == (False,)
    assert made.correction == (0.0,)


def test_axes_without_an_observer_get_what_was_planned():
    made = StageObserver([None, DESIGN], [COARSE, COARSE], PERIOD, 1e-4)
    assert made.is_on == (False, True)
    planned = np.array([[12.4, 3.0], [-40000.0, 3.0]])
    made.begin(np.zeros((2, 2), np.int64), planned, [0, 0], False)
    made.sample[:] = (-500, 0, 1, 0)
    assert made.offsets(0, 1, 0.0)[0] == 12
    assert made.offsets(1, 1, 0.0)[0] == -32768


def test_the_next_stream_starts_from_the_correction():
    made = observer()
    before = follow(made, [0, -10, -20, -20])[-1]
    for continued in (True, False):
        made.begin(np.zeros((9, 1), np.int64), np.zeros((9, 1)), [0], continued)
        assert made.correction[0] == before
    made.offsets(0, 1, 0.0)
    assert made.correction[0] == pytest.approx(before, abs=1.0 * 20e-9 * 341e3)


def test_another_design_goes_on_from_the_correction():
    made = observer()
    before = follow(made, [0, -10, -20, -20])[-1]
    made.redesign(0, without_presliding(DESIGN))
    assert made.correction[0] == before
    assert follow(made, [0])[0] == pytest.approx(before, abs=0.02)  # begins anew
    other = StageObserver([without_presliding(DESIGN)], [COARSE], PERIOD, 1e-4)
    for own, fresh in zip(made._observers, other._observers, strict=True):  # noqa: SLF001
        np.testing.assert_array_equal(own, fresh)


def test_figures_of_the_axis_may_be_off():
    for mass, stiffness in ((6.0, 0.0), (6.0, 9e5), (10.0, 0.0), (10.0, 9e5)):
        plant = Plant(carriage=replace(CARRIAGE, mass=mass, stiffness=stiffness))
        deviation, _, _ = closed_loop(DESIGN, np.full(200, 2.0), np.zeros((200, 10)), plant)
        assert np.abs(deviation[120:]).max() < 50e-9
