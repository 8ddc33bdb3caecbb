"""The thread that owns the stage."""

import time

import pytest

from drivers import Stage
from stagectl.config import driver_settings, load_machine
from stagectl.errors import Aborted
from stagectl.server.handover import Handover, JobEnded
from stagectl.server.keeper import Simulated, StageKeeper, Work

LONG = 60.0


def made_keeper():
    machine, handover = load_machine(), Handover()
    made = StageKeeper(*driver_settings(machine), Simulated(machine, 1), handover, LONG)
    made.handover = handover
    return made


@pytest.fixture
def keeper():
    made = made_keeper()
    made.start()
    assert made.ready.wait(LONG)
    yield made
    made.end()
    made.join(LONG)


def ended(keeper, job):
    deadline = time.monotonic() + LONG
    while time.monotonic() < deadline:
        for item in list(keeper.handover.items):
            if isinstance(item, JobEnded) and item.job == job:
                return item
        time.sleep(0.01)
    raise AssertionError(f"job {job} has not ended")


def test_a_stop_while_the_stage_is_closed_stops_what_was_to_have_the_bus(keeper, monkeypatch):
    close, stop, done = Stage.close, keeper.handover.stop, []

    def pressed(stage):
        stop.press("enough")
        close(stage)

    def alone(bus):
        stop.check()  # as everything on the bus does with every frame
        done.append(bus)

    monkeypatch.setattr(Stage, "close", pressed)
    keeper.submit(Work(1, "moving", "alone", None, alone))
    stopped = ended(keeper, 1)
    monkeypatch.undo()
    assert isinstance(stopped.error, Aborted)
    assert "enough" in str(stopped.error)
    assert not done


def test_a_stop_between_jobs_does_not_end_the_next_one(keeper):
    keeper.handover.stop.press("for lunch")
    deadline = time.monotonic() + LONG
    while not any("for lunch" in str(item) for item in list(keeper.handover.items)):
        assert time.monotonic() < deadline
        time.sleep(0.01)
    keeper.submit(Work(1, "enabling", "enabling", lambda stage: stage.enable()))
    assert ended(keeper, 1).error is None
    assert keeper.stage.enabled


def test_a_stop_ends_what_has_not_begun():
    keeper = made_keeper()
    keeper.submit(Work(1, "moving", "moving x", lambda stage: stage.enable()))
    keeper.stop("enough")
    (item,) = keeper.handover.items
    assert (item.job, str(item.error)) == (1, "enough")
    with pytest.raises(Aborted, match="enough"):
        keeper.handover.stop.check()
