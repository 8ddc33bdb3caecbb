"""The host run again on its own log."""

import json
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
from tests.unit.stagectl.run.whole import request_for, stopping_at


def test_a_log_in_parts_is_replayed_like_one_file(logged, tmp_path):
    seal = read_log(logged / "bus.asc").digest
    frames = list(read_log(logged / "bus.asc").frames())
    (logged / "bus.asc").unlink()
    with BusLog(logged / "bus.asc", datetime.now(UTC), part_frames=len(frames) // 2) as log:
        for number, frame in enumerate(frames):
            log.tap(frame.time_ns, frame.can_id, frame.data)
            while number == len(frames) // 4 and not (logged / "bus-002.frames").exists():
                time.sleep(0.001)
    assert not (logged / "bus.asc").exists()
    result = replay(logged)
    assert (result.difference, result.sealed, result.digest) == (None, True, seal)


@pytest.mark.parametrize("kept", [0.6, 1.0], ids=["shorter", "another digit"])
def test_a_log_that_changes_during_the_replay_is_refused(logged, kept):
    log = logged / "bus.asc"

    def change(_):
        lines = log.read_text().splitlines(keepends=True)
        lines = lines[: round(kept * len(lines))]
        at = next(i for i in range(len(lines) - 20, 0, -1) if " Rx " in lines[i])
        lines[at] = lines[at][:-2] + "9\n"
        log.write_text("".join(lines))

    with pytest.raises(UnusableInput, match=r"bus\.asc: has changed since it was checked"):
        replay(logged, Listener(phase=change))


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
        of = {"simulated": SimulatedStage(machine, wafer), "history": str(where)}
        request = request_for(machine, tmp_path / str(wafer), RECIPE, **of)
        assert execute(request, Listener()).summary["outcome"] == "completed"
    where.unlink()
    again = replay(tmp_path / "1")
    assert again.difference is None
    assert again.compared > 2000


def test_a_stop_by_the_operator_comes_at_the_same_sample(machine, tmp_path):
    result = run(machine, tmp_path / "run", listener=stopping_at(MoveStarted, 2))
    assert result.summary["outcome"] == "aborted"
    assert replay(tmp_path / "run").difference is None


def test_a_host_that_sends_less_or_more(logged):
    log = logged / "bus.asc"
    whole = log.read_text()
    more = " 999.000000 1  80  Tx   d 0\n"
    log.write_text(whole.replace("End TriggerBlock", f"{more}End TriggerBlock"))
    less = replay(logged).difference
    assert (less.sent, less.recorded.can_id) == (None, 0x80)
    lines = whole.splitlines(keepends=True)
    log.write_text("".join(lines[:3000]))
    more = replay(logged)
    assert more.sealed is False  # the recording knows the digest
    assert more.difference.recorded is None


def test_unusable_runs(logged, tmp_path):
    with pytest.raises(UnusableInput, match="no such folder"):
        replay(tmp_path / "nobody")
    (tmp_path / "empty").mkdir()
    with pytest.raises(UnusableInput, match="holds no recording"):
        replay(tmp_path / "empty")
    log = logged / "bus.asc"
    text = log.read_text()
    log.write_text(text.replace(" d 8 ", " d 7 ", 1))
    with pytest.raises(UnusableInput, match=r"bus\.asc:\d+: states 7 bytes, has 8"):
        replay(logged)
    log.unlink()
    with pytest.raises(UnusableInput, match=r"bus\.asc: No such file"):
        replay(logged)
    log.write_text(text)
    for change, reason in (
        ({"simulated": False}, "was run in real time"),
        ({"map": 3}, "used friction map 3 as it stood then"),
        ({"map": 3, "map_then": {"content": "{}"}}, "/events: damaged"),
        ({"calibration": True}, "was a calibration"),
        ({"slipped": 2}, "had calibration sites inserted"),
        ({"seed": None}, "/events: damaged"),
    ):
        with h5py.File(logged / "recording.h5", "r+") as file:
            events = [json.loads(text) for text in file["events"]]
            (at,) = (n for n, event in enumerate(events) if event["event"] == "run")
            whole, file["events"][at] = file["events"][at], json.dumps({**events[at], **change})
        with pytest.raises(UnusableInput, match=reason):
            replay(logged)
        with h5py.File(logged / "recording.h5", "r+") as file:
            file["events"][at] = whole
