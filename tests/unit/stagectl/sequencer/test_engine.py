"""The engine on a plant without a bus: order of steps, settling, stops, missing marks."""

from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest

from estimation.trajectory import Limits
from hil_sim.plant import Plant
from stagectl.config import load_machine, stage_settings
from stagectl.errors import Aborted, RunFault
from stagectl.recipe import (
    DoneStep,
    Dwell,
    Excite,
    ExposeStep,
    FiducialStep,
    MoveStep,
    Profile,
    Settle,
)
from stagectl.sequencer import (
    Continued,
    Engine,
    Exposed,
    FrictionUpdated,
    MarkFound,
    MarkNotFound,
    Mode,
    MoveStarted,
    MovingAxis,
    Paused,
    PauseRequest,
    Settled,
    Stopping,
    Waiting,
    make_compensation,
)
from stagedata import Samples

TS = 1e-3
MACRO, MICRO = Profile(0.5, 3.0, 200.0), Profile(0.01, 0.2, 20.0)
SETTLE = Settle(5e-8, 0.005, 0.15, "continue")


class BareStage:
    """The simulated mechanics behind the engine's port, no bus in between."""

    def __init__(self):
        self.settings = stage_settings(load_machine())
        self.plant = Plant(self.settings, 1)
        for a in range(2):
            self.plant.power(a, True)
        self.count = 0
        self.demands = []
        self.offsets = []
        self.at_sample = {}

    streams = True

    @property
    def targets(self):
        return (0.0, 0.0)

    def stream(self, position, offset, until=None):
        position = np.round(position / 1e-9) * 1e-9
        seen, force = [], []
        for target, extra in zip(position, offset, strict=True):
            if self.count in self.at_sample:
                self.at_sample[self.count]()
            self.plant.advance_to(self.count * 1_000_000)
            seen.append([self.plant.encoder(a) * 1e-9 for a in range(2)])
            force.append([self.plant.force(a) for a in range(2)])
            for a in range(2):
                self.plant.command(a, target[a], extra[a], self.settings.ticks)
            self.demands.append(target)
            self.offsets.append(extra)
            self.count += 1
            if until is not None and until(tuple(seen[-1])):
                break
        count = len(seen)
        return replace(
            Samples.missing(count, 2),
            position=np.array(seen),
            force=np.array(force),
            valid=np.ones((count, 2), dtype=bool),
            time=np.arange(self.count - count, self.count) * TS,
            arrival=np.zeros((count, 2)),
            doubt=np.full(count, np.inf),
        )


class Marks:
    def __init__(self, offset=(3e-5, -2e-5)):
        self.offset = offset
        self.asked = []

    def find(self, site, position):
        self.asked.append((site, position))
        return self.offset


def make(mode=Mode.ESTIMATED, marks=None, pause=None, on_event=None):
    machine = load_machine()
    stage = BareStage()
    compensation = make_compensation(machine, mode)
    axes = [
        MovingAxis(name, Limits(a.limits.velocity, a.limits.acceleration, a.limits.jerk), 1e-9, c)
        for (name, a), c in zip(machine.axes.items(), compensation, strict=True)
    ]
    moves = []
    events = []
    engine = Engine(
        stage, axes, marks or Marks(), TS, moves.append, on_event or events.append, pause=pause
    )
    return engine, stage, moves, events


def site(number, position):
    return [
        MoveStep(number, "macro", position, MACRO),
        SETTLE,
        FiducialStep(number),
        MoveStep(number, "micro", None, MICRO),
        SETTLE,
        ExposeStep(0.02),
    ]


def test_a_site_goes_macro_settle_learn_micro_settle_expose():
    marks = Marks()
    engine, stage, moves, events = make(marks=marks)
    engine.run([*site(1, (0.02, 0.01)), *site(2, (0.04, 0.01))])
    assert [m.kind for m in moves] == ["macro", "micro", "macro", "micro"]
    assert [m.site for m in moves] == [1, 1, 2, 2]
    assert moves[1].target == {"x": pytest.approx(0.02003), "y": pytest.approx(0.00998)}
    assert moves[1].origin == moves[0].target
    assert marks.asked == [(1, (0.02, 0.01)), (2, (0.04, 0.01))]
    waits = [e.reason for e in events if isinstance(e, Waiting)]
    assert waits == ["settling", "looking for the mark", "settling", "exposing"] * 2
    kinds = [type(e) for e in events if not isinstance(e, Waiting)]
    # The macro-move has been learned from before the micro-move begins.
    first = kinds.index(FrictionUpdated)
    assert kinds[:first] == [MoveStarted, Settled, MarkFound]
    assert kinds[first : first + 3] == [FrictionUpdated, FrictionUpdated, MoveStarted]
    assert kinds.count(Exposed) == 2
    for move in moves:
        assert stage.demands[move.end - 1] == pytest.approx(list(move.target.values()), abs=1e-9)


def test_moves_span_the_samples_in_which_the_demand_moves():
    engine, stage, moves, _ = make()
    engine.run(site(1, (0.02, 0.0)))
    demand = np.array(stage.demands)
    macro, micro = moves
    assert (demand[macro.start - 1] == demand[0]).all()
    assert (demand[macro.start] != demand[0]).any()
    assert (demand[macro.end - 1 : micro.start] == demand[macro.end - 1]).all()
    assert engine.samples == len(demand)


def test_force_offsets_never_jump():
    engine, stage, _, _ = make()
    engine.run([*site(1, (0.02, 0.01)), *site(2, (0.04, -0.01))])
    offsets = np.array(stage.offsets)
    jerk = np.array([8.0, 14.0]) * 200.0 * TS
    # Largest step: mass times jerk for one period, and friction building up at the onset.
    assert (np.abs(np.diff(offsets, axis=0)) < 2.0 * jerk + 4.0).all()
    settle_begin = np.abs(np.diff(np.array(stage.demands), axis=0)).max(axis=1) == 0.0
    assert np.abs(np.diff(offsets, axis=0))[settle_begin][:-1].max() < 1.5


def test_settles_as_soon_as_the_window_is_held():
    engine, _, _, events = make(Mode.ORACLE)
    engine.run(site(1, (0.02, 0.01)))
    settled = [e for e in events if isinstance(e, Settled)]
    assert all(e.settled for e in settled)
    assert all(e.duration < 0.12 for e in settled)
    assert min(e.duration for e in settled) >= 0.005 - 1e-12


@pytest.mark.parametrize(
    ("on_timeout", "waits", "fault"),
    [
        ("continue", 1, None),
        ("stop", 1, "site 1: macro-move did not settle"),
        ("retry", 4, "within 120 ms .*retry"),
    ],
)
def test_a_timeout_continues_stops_or_retries_as_the_recipe_says(on_timeout, waits, fault):
    engine, _, _, events = make(Mode.NONE)
    steps = [MoveStep(1, "macro", (0.01, 0.0), MACRO), Settle(1e-10, 0.05, 0.03, on_timeout)]
    with nullcontext() if fault is None else pytest.raises(RunFault, match=fault):
        engine.run(steps)
    assert [e.settled for e in events if isinstance(e, Settled)] == [False] * waits
    assert isinstance(events[-1], Stopping) == (fault is not None)


def test_without_a_mark_there_is_no_micro_move():
    engine, _, moves, events = make(marks=Marks(None))
    engine.run(site(1, (0.01, 0.0)))
    assert [m.kind for m in moves] == ["macro"]
    assert MarkNotFound(1) in events
    assert Exposed(1) in events


def test_a_stop_in_mid_move_decelerates_within_the_limits():
    engine, stage, moves, events = make(Mode.ORACLE)
    stage.at_sample[220] = lambda: engine.stop("by test")
    with pytest.raises(Aborted, match="by test"):
        engine.run([*site(1, (0.05, 0.03)), *site(2, (0.0, 0.0))])
    demand = np.array(stage.demands)
    assert moves[0].start < 220 < moves[0].end
    speed = np.diff(demand, axis=0) / TS
    acceleration = np.diff(speed, axis=0) / TS
    assert np.abs(acceleration[:, 0]).max() < 10.0 * 1.01  # the axis' own limit
    assert not speed[-1].any()
    assert len(demand) < 220 + 200
    assert 0.0 < demand[-1, 0] < 0.05
    actual = [stage.plant.encoder(a) * 1e-9 for a in range(2)]
    assert np.abs(demand[-1] - actual).max() < 5e-5  # a twentieth of the following error window
    assert isinstance(events[-1], Stopping)
    assert len(moves) == 1


def test_a_stop_while_an_axis_is_shaken_decelerates_within_the_limits():
    engine, stage, moves, _ = make()
    excitation = Excite(0, "chirp", 5e-4, (2.0, 50.0), 4.0, MACRO)
    stage.at_sample[2220] = lambda: engine.stop("by test")
    with pytest.raises(Aborted, match="by test"):
        engine.run([excitation])
    assert len(stage.demands) < 2500
    path = np.array(stage.demands)[:, 0]
    assert np.abs(np.diff(path, 2)).max() / TS**2 < 10.0 * 1.01
    assert moves[0].origin == moves[0].target
    assert path[-1] == path[-2], "at rest"


def test_a_stop_at_rest_takes_effect_at_once():
    engine, stage, moves, _ = make()
    stage.at_sample[50] = lambda: engine.stop("early")
    with pytest.raises(Aborted):
        engine.run(site(1, (0.05, 0.03)))
    assert engine.samples == 51
    assert moves == []


@pytest.mark.parametrize("most", [0.5, 0.15])
def test_a_pause_begins_after_the_segment_and_ends_the_run_where_it_is_too_long(most):
    pause = PauseRequest(most)
    events, ended = [], []

    def note(event):
        events.append(event)
        if isinstance(event, Paused):
            ended.append((len(moves), stage.count))
            stage.at_sample[stage.count + 300] = pause.withdraw

    engine, stage, moves, _ = make(pause=pause, on_event=note)
    stage.at_sample[150] = pause.ask  # in the first site's macro-move
    steps = [*site(1, (0.01, 0.0)), DoneStep(1, 1), *site(2, (0.02, 0.0)), DoneStep(2, 2)]
    with nullcontext() if most > 0.3 else pytest.raises(Aborted, match=r"paused for longer"):
        engine.run(steps)
    assert ended[0][0] == 2  # macro and micro of the first site
    held = np.array(stage.demands[ended[0][1] : ended[0][1] + 100])
    assert (held == held[0]).all()
    assert len(moves) == (4 if most > 0.3 else 2)
    assert any(isinstance(e, Continued) for e in events) == (most > 0.3)


def test_moves_can_be_relative_with_dwells_between():
    engine, _, moves, _ = make()
    there = MoveStep(None, "creep", (1e-3, 0.0), Profile(0.005, 0.5, 50.0))
    engine.run([there, Dwell(0.05), MoveStep(None, "other", None, MICRO, (-1e-4, 0.0))])
    assert [m.kind for m in moves] == ["creep", "other"]
    assert moves[1].start - moves[0].end == 50
    assert moves[1].target["x"] == pytest.approx(9e-4)
    assert moves[0].site is None
