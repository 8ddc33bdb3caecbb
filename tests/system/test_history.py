"""A run's friction estimates in the history: all of them, once, with what they belong to."""

import math
from dataclasses import replace
from datetime import UTC, datetime

import pytest

from stagectl.compensation import Mode
from stagectl.config.machine import parse_machine
from stagectl.errors import StagectlError, UnusableInput
from stagectl.history.opening import open_history
from stagectl.history.records import RunEntry, StageKey
from stagectl.history.run_history import RunHistory
from stagectl.recipe.load import parse_recipe
from stagectl.request import RunRequest
from stagectl.sequencer.events import FrictionUpdated
from stagectl.session import Listener, execute
from tests.system.short_recipe import short_recipe

SHORT = short_recipe((0.01, 0.0), (0.02, 0.01)) + "lot: L42\nwafer: 7\n"
STAGE = StageKey("wafer-xy", True)


@pytest.fixture
def request_(machine, tmp_path):
    return RunRequest(
        parse_recipe(SHORT, "short.yaml", machine), machine, machine, None, Mode.ESTIMATED, 1.0, 1,
        tmp_path / "run", datetime.now(UTC), history=str(tmp_path / "stage.db"),
    )  # fmt: skip


def test_every_estimate_of_a_run_is_in_the_history(request_, tmp_path):
    # The reading of the kp object stands for a thermometer: 341,000 counts of 1e-4 deg C.
    text = request_.machine.text + (
        'temperature: {axis: x, object: "0x2000:01", scale: 1.0e-4, offset: -10.0}\n'
    )
    warm = replace(request_, machine=parse_machine(text, "warm"))
    summary = execute(warm, Listener()).summary
    history = open_history(request_.history)
    ((number, run, outcome),) = history.runs(STAGE)
    assert (run.recipe, run.lot, run.wafer, run.seed, outcome) == (
        "short", "L42", "7", 1, "completed"
    )  # fmt: skip
    assert run.software.startswith("stagectl ")
    assert run.started == pytest.approx(request_.started.timestamp())
    accepted = [e for e in summary["friction"] if e["accepted"]]
    assert history.counted(STAGE) == (len(accepted), len(summary["friction"]) - len(accepted))
    assert len(accepted) >= 6
    assert history.places(STAGE) == [(0.01, 0.0), (0.02, 0.01)]
    for row in history.at_date(STAGE, math.inf):
        last = [e for e in accepted if (e["axis"], e["site"]) == (row.axis, row.site)][-1]
        figure = last["parameters"]["coulomb"]
        assert row.figures["coulomb"] == figure["value"]
        assert row.sigma("coulomb") == pytest.approx(figure["sigma"])
        assert 0.0 < row.time - run.started <= summary["duration"] + 1e-6  # a float's resolution
        assert row.temperature == pytest.approx(24.1, abs=0.1)
        assert row.run == number
    history.close()


def test_a_history_that_cannot_be_used_is_refused_before_anything_moves(request_, tmp_path):
    (tmp_path / "stage.db").write_text("my notes\n" * 1000)
    with pytest.raises(UnusableInput, match="not an SQLite file"):
        execute(request_, Listener())
    assert not list((tmp_path / "run").glob("*"))
    assert (tmp_path / "stage.db").read_text() == "my notes\n" * 1000


class Full:
    """A history whose disk is full once the run is noted, for `refused` writes."""

    name = "full"
    closed = False

    def __init__(self, refused=math.inf):
        self.refused, self.tried, self.rows, self.outcome = refused, 0, [], None

    def start_run(self, run):
        return 1

    def add(self, estimates):
        self.tried += 1
        if self.tried <= self.refused:
            raise StagectlError("stage.db: database or disk is full")
        self.rows += estimates

    def end_run(self, run, outcome, fault):
        self.outcome = outcome

    def close(self):
        self.closed = True


@pytest.mark.parametrize("refused", [1, math.inf])
def test_a_history_that_fails_on_the_way_is_left_and_tried_again_at_the_end(request_, refused):
    """A run does not wait for it twice; one that was only busy has all of the run in the end."""
    full = Full(refused)
    stage = StageKey("m", True)
    history = RunHistory(full, RunEntry(stage, ("x",), 0.0, "r", None, None, "s", "f"))
    noted = []

    def note(event):
        if isinstance(event, FrictionUpdated):
            noted.append(event)
            history.note(event)

    execute(replace(request_, history=None), Listener(event=note))
    assert full.tried == 1 < len(noted)
    history.end("completed", None)
    assert full.closed
    if refused == 1:
        assert (history.failure, full.outcome) == (None, "completed")
        assert [(row.axis, row.kind) for row in full.rows] == [(e.axis, e.kind) for e in noted]
    else:
        assert history.failure == "stage.db: database or disk is full"
        assert (full.rows, full.outcome) == ([], None)
