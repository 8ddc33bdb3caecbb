"""The host run again on its own log."""

import json
import shutil
import time
from datetime import UTC, datetime

import h5py
import pytest

from estimation.field import Node
from hil_sim.bus import faults as f
from stagectl.errors import UnusableInput
from stagectl.history import StageKey, open_history
from stagectl.maps import FrictionMap, to_json
from stagectl.maps.model import MapAxis, MapSite
from stagectl.run import Listener, SimulatedStage, execute
from stagectl.run.replay import replay
from stagectl.sequencer import MoveStarted
from stagectl.store import BusLog, read_log
from tests.unit.stagectl.run.replay.logged import RECIPE, run
from tests.unit.stagectl.run.whole import request_for


@pytest.fixture(scope="module")
def made(machine, tmp_path_factory):
    """The folder of a run without faults."""
    folder = tmp_path_factory.mktemp("made") / "run"
    assert run(machine, folder).summary["outcome"] == "completed"
    return folder


@pytest.fixture
def folder(made, tmp_path):
    """A copy of it, to be changed."""
    return shutil.copytree(made, tmp_path / "run")


def test_a_log_in_parts_is_replayed_like_one_file(folder, tmp_path):
    seal = read_log(folder / "bus.asc").digest
    frames = list(read_log(folder / "bus.asc").frames())
    (folder / "bus.asc").unlink()
    with BusLog(folder / "bus.asc", datetime.now(UTC), part_frames=len(frames) // 2) as log:
        for number, frame in enumerate(frames):
            log.tap(frame.time_ns, frame.can_id, frame.data)
            while number == len(frames) // 4 and not (folder / "bus-002.frames").exists():
                time.sleep(0.001)
    assert not (folder / "bus.asc").exists()
    result = replay(folder)
    assert (result.difference, result.sealed, result.digest) == (None, True, seal)


@pytest.mark.parametrize("kept", [0.6, 1.0], ids=["shorter", "another digit"])
def test_a_log_that_changes_during_the_replay_is_refused(folder, kept):
    log = folder / "bus.asc"

    def change(_):
        lines = log.read_text().splitlines(keepends=True)
        lines = lines[: round(kept * len(lines))]
        at = next(i for i in range(len(lines) - 20, 0, -1) if " Rx " in lines[i])
        lines[at] = lines[at][:-2] + "9\n"
        log.write_text("".join(lines))

    with pytest.raises(UnusableInput, match=r"bus\.asc: has changed since it was checked"):
        replay(folder, Listener(phase=change))


@pytest.mark.parametrize(
    ("faults", "retries", "outcome"),
    [
        ((f.DriveFault(2, 0x8611, at=2.5),), 1, "completed"),
        ((f.Delay(f.Frames(frozenset({0x80}), "host"), 0.0, 2e-5),
          f.Drop(f.Frames(frozenset({0x181}), "drives", probability=0.01)),
          f.DriveFault(1, 0x2310, at=2.5)), 0, "fault"),
        ((f.BusOff(None, 2.5, 0.02),), 0, "fault"),
    ],
    ids=["a site begun again", "jitter, loss and a fault", "bus-off"],
)  # fmt: skip
def test_the_host_does_the_same_again(machine, tmp_path, faults, retries, outcome):
    folder = tmp_path / "run"
    result = run(machine, folder, *faults, retries=retries)
    assert result.summary["outcome"] == outcome
    again = replay(folder)
    assert again.difference is None
    assert again.sealed is True
    sent = (folder / "bus.asc").read_text().count(" Tx ")
    assert again.compared == sent > 3000


def test_a_run_by_a_map_goes_by_it_as_it_stood(machine, tmp_path):
    """What the sites had shown up to the run goes into its force offsets; the history may go."""
    stage, begin = StageKey("wafer-xy", True), 1.7e9
    where = tmp_path / "stage.db"
    history = open_history(str(where), write=True)
    places = [(0.0, -0.01), (0.02, -0.01), (0.0, 0.01), (0.02, 0.01)]
    sites = tuple(MapSite(p, 6.0 + 50 * p[0], 0.02, begin, 4) for p in places)
    axis = MapAxis(sites, (Node(1.0, "matern 5/2", 0.04, 0.1, 0.02),), {"viscous": (20.0, 0.5)})
    content = to_json(FrictionMap(stage, begin, {"x": axis, "y": axis}))
    history.activate(stage, history.save_map(stage, begin, "", content), begin, "activated")
    history.close()
    for wafer in range(2):
        stage_now = SimulatedStage(machine, wafer)
        request = request_for(
            machine, tmp_path / str(wafer), RECIPE, simulated=stage_now, history=str(where)
        )
        assert execute(request, Listener()).summary["outcome"] == "completed"
    where.unlink()
    again = replay(tmp_path / "1")
    assert again.difference is None
    assert again.compared > 2000


def test_a_stop_by_the_operator_comes_at_the_same_sample(machine, tmp_path):
    begun = []

    def event(happened):
        begun.append(happened)
        if sum(isinstance(e, MoveStarted) for e in begun) == 3 and ask:
            ask.pop()("stopped by the operator")

    ask = []
    listener = Listener(event=event, stoppable=ask.append)
    assert run(machine, tmp_path / "run", listener=listener).summary["outcome"] == "aborted"
    assert replay(tmp_path / "run").difference is None


def test_a_host_that_sends_less_or_more(folder):
    log = folder / "bus.asc"
    whole = log.read_text()
    log.write_text(
        whole.replace("End TriggerBlock", " 999.000000 1  80  Tx   d 0\nEnd TriggerBlock")
    )
    less = replay(folder).difference
    assert less.sent is None
    assert less.recorded.can_id == 0x80
    lines = whole.splitlines(keepends=True)
    log.write_text("".join(lines[:3000]))
    more = replay(folder)
    assert more.sealed is False  # the recording knows the digest
    assert more.difference.recorded is None


def test_unusable_runs(folder, tmp_path):
    with pytest.raises(UnusableInput, match="no such folder"):
        replay(tmp_path / "nobody")
    (tmp_path / "empty").mkdir()
    with pytest.raises(UnusableInput, match="holds no recording"):
        replay(tmp_path / "empty")
    log = folder / "bus.asc"
    text = log.read_text()
    log.write_text(text.replace(" d 8 ", " d 7 ", 1))
    with pytest.raises(UnusableInput, match=r"bus\.asc:\d+: states 7 bytes, has 8"):
        replay(folder)
    log.unlink()
    with pytest.raises(UnusableInput, match=r"bus\.asc: No such file"):
        replay(folder)
    log.write_text(text)
    for change, reason in (
        ({"simulated": False}, "was run in real time"),
        ({"map": 3}, "used friction map 3 as it stood then"),
        ({"map": 3, "map_then": {"content": "{}"}}, "/events: damaged"),
        ({"calibration": True}, "was a calibration"),
        ({"slipped": 2}, "had calibration sites inserted"),
        ({"seed": None}, "/events: damaged"),
    ):
        with h5py.File(folder / "recording.h5", "r+") as file:
            events = [json.loads(text) for text in file["events"]]
            (at,) = (n for n, event in enumerate(events) if event["event"] == "run")
            whole, file["events"][at] = file["events"][at], json.dumps({**events[at], **change})
        with pytest.raises(UnusableInput, match=reason):
            replay(folder)
        with h5py.File(folder / "recording.h5", "r+") as file:
            file["events"][at] = whole
