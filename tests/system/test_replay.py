"""`stagectl replay`: the host run again on its own log."""

import json
import re
import shutil
import time
from datetime import UTC, datetime

import h5py
import pytest
from click.testing import CliRunner

from estimation.field import Node
from hil_sim.bus import faults as f
from stagectl.cli import cli
from stagectl.errors import UnusableInput
from stagectl.history import StageKey, open_history
from stagectl.maps import FrictionMap, to_json
from stagectl.maps.model import MapAxis, MapSite
from stagectl.recipe import parse_recipe
from stagectl.run import Listener, RunRequest, execute
from stagectl.run.replay import replay
from stagectl.sequencer import Mode, MoveStarted
from stagectl.store import BusLog, read_log
from tests.system.short_recipe import short_recipe

RECIPE = short_recipe((0.004, -0.003), (0.01, 0.002))


def run(machine, folder, *faults, listener=None, retries=0):
    request = RunRequest(
        parse_recipe(RECIPE, "short.yaml", machine), machine, machine, None, Mode.ESTIMATED, 0.5,
        1, folder, datetime.now(UTC), f.FaultPlan(tuple(faults), 1), retries,
    )  # fmt: skip
    return execute(request, listener or Listener())


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


def edit(path, pattern, replacement, occurrence):
    """Change one of the lines that match; returns the number of the frame in the log."""
    lines = path.read_text().splitlines(keepends=True)
    hits = [n for n, line in enumerate(lines) if re.search(pattern, line)]
    chosen = hits[occurrence]
    lines[chosen] = re.sub(pattern, replacement, lines[chosen])
    path.write_text("".join(lines))
    return chosen - 4  # five lines come before the first frame


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
        request = RunRequest(
            parse_recipe(RECIPE, "short.yaml", machine), machine, machine, None, Mode.ESTIMATED,
            1.0, wafer, tmp_path / str(wafer), datetime.now(UTC), history=str(where),
        )  # fmt: skip
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


def test_a_frame_that_the_host_sends_differently_is_the_first_one_told(folder, stagectl):
    number = edit(folder / "bus.asc", r"( 201 .* d 8 \w\w \w\w) \w\w", r"\1 7F", 900)
    edit(folder / "bus.asc", r"( 202 .* d 8 \w\w \w\w) \w\w", r"\1 7F", 950)
    result = CliRunner().invoke(cli, ["replay", str(folder)])
    assert result.exit_code == 1
    assert "was modified after the run" in result.output
    assert f"differs at frame {number}" in result.output
    assert result.output.count("RPDO 1 of axis x: enable operation") == 2
    assert stagectl("replay", folder).returncode == 1  # the program's own, not click's


def test_what_the_host_gets_differently_shows_where_it_acts_on_it(folder):
    """A position that was received otherwise changes an offset later on, by the estimate."""
    number = edit(folder / "bus.asc", r"( 181 .* d 8) 37 12", r"\1 18 02", 400)  # FAULT
    result = CliRunner().invoke(cli, ["replay", str(folder), "--json", "-"])
    difference = json.loads(result.output)["difference"]
    assert difference["number"] > number
    assert "quick stop" in difference["sent"]["meaning"]
    assert "enable operation" in difference["recorded"]["meaning"]


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
