"""The stage server as users meet it: a process of its own, virtual drives paced by the clock.

What those do is as in virtual time, however late the machine is.
"""

import itertools
import json
import signal
import subprocess
import threading
import time
from contextlib import contextmanager

import msgpack
import pytest
import yaml
import zmq

from stagectl.client import Client, JobFailed, NoServer, Refused
from stagectl.config import load_machine
from stagectl.protocol import requests as ask
from stagectl.protocol.endpoint import Endpoint, endpoint
from stagectl.store import read_notes, read_recording
from tests.processes import drives_on, slow_machine, start
from tests.waiting import LONG, wait_until

RECIPE = """
recipe: short
macro: {velocity: 0.3, acceleration: 3.0, jerk: 300.0}
micro: {velocity: 0.01, acceleration: 0.2, jerk: 20.0}
settle: {window: 1.0e-6, hold: 0.01, timeout: 0.5}
expose: 0.05
fiducial: {source: simulated, range: 80.0e-6, seed: 1}
sites: [[0.01, 0.01], [0.03, 0.01], [0.03, 0.03], [0.01, 0.03]]
"""
_numbers = itertools.count()


@contextmanager
def serving(folder, *arguments):
    """A server in this folder; yields its process, and ends it in order."""
    name = f"test-{next(_numbers)}"
    with start("serve", "--name", name, "--data", folder / "runs", *arguments) as process:
        try:
            line = ""
            while "serving" not in line:
                line = process.stdout.readline()
                assert line, process.stderr.read()
            process.server = name
            yield process
        finally:
            if process.poll() is None:
                process.send_signal(signal.SIGTERM)
            _, errors = process.communicate(timeout=LONG)
    assert process.returncode in (0, -signal.SIGKILL), errors
    assert "Traceback" not in errors
    assert "leaked" not in errors


@pytest.fixture(scope="module")
def runtime(tmp_path_factory):
    folder = tmp_path_factory.mktemp("rt")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("STAGECTL_RUNTIME", str(folder))
        folder.chmod(0o700)
        yield folder


@pytest.fixture(scope="module")
def server(runtime, tmp_path_factory):
    with serving(tmp_path_factory.mktemp("server"), "--simulate") as process:
        yield process.server


@pytest.fixture
def client(server):
    with Client(server, "anna") as client:
        until(client, lambda s: s.run is None and s.job is None)
        yield client
        client.release()


def until(client, condition):
    deadline = time.monotonic() + LONG
    while True:
        state = client.state()
        if condition(state):
            return state
        assert time.monotonic() < deadline, state
        time.sleep(0.02)


def queue(client, folder, text=RECIPE, **more):
    asked = ask.QueueAdd(recipe=text, source="short.yaml", folder=str(folder), start=True, **more)
    return client.ask(asked)["id"]


def entry(state, number):
    return next(e for e in state.queue if e.id == number)


def test_axes_are_homed_once_and_stay_held_between_commands(client):
    client.do(ask.Home())
    state = client.state()
    assert state.homed
    assert state.doing == "held"
    assert 0 < state.hold_left <= client.info.hold_limit
    before = state.axes[0].position
    moved = client.do(ask.Move(axis="x", distance=2e-3, velocity=0.02)).result
    assert moved["position"] - before == pytest.approx(2e-3, abs=1e-6)
    assert client.state().enabled
    with pytest.raises(JobFailed, match="outside its travel"):
        client.do(ask.Move(axis="x", position=1.0))
    with pytest.raises(Refused, match="velocity"):
        client.do(ask.Move(axis="x", position=0.0, velocity=5.0))
    with pytest.raises(Refused, match="no axis 'z'"):
        client.do(ask.Move(axis="z", position=0.0))


def test_a_jog_goes_on_while_it_is_renewed_and_ends_by_itself(client):
    client.do(ask.Home())
    job = client.begin(ask.Jog(axis="y", velocity=0.01))
    for _ in range(10):
        time.sleep(0.05)
        assert client.begin(ask.Jog(axis="y", velocity=0.01)).id == job.id
    ended = client.wait(job, 2.0).result
    assert 4e-3 < ended["position"] - ended["start"] < 9e-3
    assert client.state().enabled


def test_anyone_may_stop_but_only_the_holder_commands(client, server):
    client.take()
    client.do(ask.Home())
    with Client(server, "bert") as other:
        assert other.state().lease.holder == "anna"
        for command in (ask.Home(), ask.Enable(), ask.Jog(axis="x", velocity=0.01), ask.Abort()):
            with pytest.raises(Refused, match="anna commands") as refused:
                other.ask(command)
            assert refused.value.refusal.kind == "not_in_command"
        job = client.begin(ask.Move(axis="x", position=0.12, velocity=0.02))
        until(other, lambda s: s.doing == "moving" and s.axes[0].demand > 5e-3)
        other.stop("smoke")
        with pytest.raises(JobFailed, match="stopped by bert: smoke"):
            client.wait(job)
        state = other.state()
        assert not state.enabled
        assert state.axes[0].position < 0.11
        other.take(force=True)
        with pytest.raises(Refused, match="bert commands"):
            client.do(ask.Enable())
        other.release()
    client.do(ask.Enable())


def test_a_run_goes_from_the_queue_to_its_files_and_outlives_its_client(client, server, tmp_path):
    with Client(server, "passing by") as other:
        number = queue(other, tmp_path / "run", operator="bert")
    state = until(client, lambda s: entry(s, number).status == "done")
    assert entry(state, number).outcome == "completed"
    assert state.enabled
    assert {p.name for p in (tmp_path / "run").iterdir()} == {
        "recording.h5", "summary.json", "report.html", "bus.asc"
    }  # fmt: skip
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert (summary["outcome"], summary["operator"]) == ("completed", "bert")
    recording = read_recording(tmp_path / "run" / "recording.h5")
    assert len(recording.moves) >= 8
    assert read_notes(tmp_path / "run" / "recording.h5").all("held_stage")
    kinds = [notice.kind for notice in client.notices()]
    assert kinds.count("segment_done") >= 4
    assert "friction" in kinds


def test_a_second_run_on_the_held_stage_is_as_good_as_the_first(client, tmp_path):
    """What the first one left of force offsets must not disturb it."""
    for name in ("first", "second"):
        number = queue(client, tmp_path / name)
        until(client, lambda s, n=number: entry(s, n).status == "done")
        summary = json.loads((tmp_path / name / "summary.json").read_text())
        assert summary["outcome"] == "completed"
        assert not any("the observer is out" in text for text in summary.get("notices", ()))
        notes = read_notes(tmp_path / name / "recording.h5")
        assert notes.all("observer_found") == []


def test_pause_resume_abort_and_stop_in_a_run(client, tmp_path):
    number = queue(client, tmp_path / "run")
    until(client, lambda s: s.run is not None and s.run.done >= 1)
    client.ask(ask.Pause())
    paused = until(client, lambda s: s.doing == "paused")
    assert paused.enabled
    with pytest.raises(Refused, match="busy"):
        client.begin(ask.Move(axis="x", distance=1e-3))
    done = paused.run.done
    time.sleep(0.3)
    assert client.state().run.done == done
    client.ask(ask.Resume())
    until(client, lambda s: s.run is not None and s.run.done > done)
    client.ask(ask.Abort(reason="enough"))
    state = until(client, lambda s: entry(s, number).status == "done")
    assert entry(state, number).outcome == "aborted"
    assert "enough" in entry(state, number).reason
    assert state.enabled  # a controlled stop: the axes stay held
    second = queue(client, tmp_path / "rest", resume=str(tmp_path / "run"))
    waiting = client.ask(ask.QueueAdd(recipe=RECIPE, source="s.yaml"))["id"]
    until(client, lambda s: s.run is not None and s.run.moves >= 2)
    client.stop()
    state = until(client, lambda s: entry(s, second).status == "done")
    assert not state.enabled
    assert entry(state, second).outcome == "aborted"
    assert entry(state, waiting).status == "waiting"  # the queue has halted
    client.ask(ask.QueueRemove(id=waiting))


def test_a_recipe_with_errors_is_refused_with_line_and_column(client):
    with pytest.raises(Refused) as refused:
        client.ask(ask.CheckRecipe(recipe=RECIPE.replace("0.3,", "30,"), source="wrong.yaml"))
    assert refused.value.refusal.kind == "input"
    assert refused.value.refusal.problems[0].startswith("wrong.yaml:3:")
    plan = client.ask(ask.CheckRecipe(recipe=RECIPE, source="short.yaml"))
    assert plan["sites"] == 4


def test_watchers_get_every_sample_in_order(client, server):
    client.do(ask.Home())
    client.do(ask.Move(axis="x", position=0.0))
    mover = threading.Thread(target=_move, args=(server, 5e-3), name="mover")
    expected, demands = None, []
    for seen in client.watch(samples=True, timeout=5.0):
        if not hasattr(seen, "first"):
            continue
        if expected is None:
            mover.start()
        assert expected is None or seen.first == expected
        expected = seen.first + len(seen.time)
        demands += seen.demand[:, 0].tolist()
        if len(demands) > 1500:
            break
    mover.join()
    assert max(demands) == pytest.approx(5e-3, abs=1e-6)


def _move(server, target):
    with Client(server, "mover") as own:
        own.do(ask.Move(axis="x", position=target, velocity=0.02))


def test_hostile_frames_are_refused_and_the_stage_does_not_move(client, server):
    client.do(ask.Home())
    before = client.state()
    context = zmq.Context()
    socket = context.socket(zmq.DEALER)
    socket.connect(Endpoint.url(endpoint(server).commands))
    frames = [
        [b""], [b"\x00" * 100], [b"a", b"b"], [msgpack.packb({"version": 1})],
        [msgpack.packb({"version": 1, "id": 3, "client": "a", "command": {"op": "format"}})],
        [msgpack.packb({"version": 2, "id": 4, "client": "a", "command": {"op": "home"}})],
    ]  # fmt: skip
    for frame in frames:
        socket.send_multipart(frame)
    kinds = []
    while len(kinds) < len(frames) and socket.poll(5000):
        kinds.append(msgpack.unpackb(socket.recv())["refusal"]["kind"])
    assert kinds == ["invalid"] * len(frames)
    good = {"version": 1, "id": 5, "client": "a", "command": {"op": "state"}}
    for _ in range(3000):
        socket.send(msgpack.packb(good))
    answered = 0
    while socket.poll(1000):
        answered += msgpack.unpackb(socket.recv())["refusal"] is None
    assert 0 < answered < 2000  # a flood is cut down, and the server answers others
    after = client.state()
    assert (after.doing, after.job) == (before.doing, None)
    assert after.axes[0].demand == before.axes[0].demand
    context.destroy(linger=0)


def test_the_command_line_runs_on_the_server(server, stagectl, tmp_path):
    (tmp_path / "short.yaml").write_text(RECIPE)
    run = stagectl("run", tmp_path / "short.yaml", "--server", server, "--out", tmp_path / "run")
    assert run.returncode == 0, run.stderr
    assert "Completed. 4 sites" in " ".join(run.stdout.split())
    jog = stagectl("jog", "x", "1mm", "--server", server)
    assert jog.returncode == 0, jog.stderr
    assert "x moved by 1.000000 mm" in jog.stdout
    stopped = start("run", tmp_path / "short.yaml", "--server", server, "--out", tmp_path / "two")
    with Client(server, "watching") as client:
        until(client, lambda s: s.run is not None and s.run.moves >= 3)
        stopped.send_signal(signal.SIGINT)
        _, errors = stopped.communicate(timeout=LONG)
        assert stopped.returncode == 130, errors
        assert "stopped by the operator (Ctrl-C)" in errors
        assert client.state().enabled
    nobody = stagectl("home", "--server", "nobody")
    assert nobody.returncode == 1
    assert "no stage server 'nobody'" in nobody.stderr


def test_drives_are_looked_at_through_the_server(client, server, stagectl):
    client.do(ask.Home())
    looks = {
        ("status", "--json", "-"): "OPERATION ENABLED",
        ("scan",): "CiA 402",
        ("sdo", "get", "x", "0x1018:02"): "0x00000402",
        ("monitor", "--for", "0.5"): "frames in",
    }
    for words, expected in looks.items():
        done = stagectl(*words, "--server", server)
        assert expected in " ".join((done.stdout + done.stderr).split()), done
    job = client.begin(ask.Move(axis="x", position=0.05, velocity=0.02))
    until(client, lambda s: s.doing == "moving")
    write = ask.SendFrame(can_id=0x601, data=b"\x2b\x40\x60\x00\x00\x00\x00\x00")
    with pytest.raises(Refused, match="busy"):  # would command the drive
        client.ask(write)
    client.ask(ask.SendFrame(can_id=0x601, data=b"\x40\x41\x60\x00\x00\x00\x00\x00"))
    client.wait(job)


@pytest.mark.slow
def test_axes_are_measured_on_the_server_after_a_question(client, server, stagectl, tmp_path):
    words = ("observer", "--measure", "--server", server, "--out", tmp_path / "r.json")
    refused = start(*words, stdin=subprocess.PIPE)
    _, errors = refused.communicate("n\n", timeout=LONG)
    assert refused.returncode == 130, errors
    assert "slides" in errors
    measured = stagectl(*words, "--yes", "--json", "-")
    assert measured.returncode == 0, measured.stderr
    axes = json.loads(measured.stdout)["axes"].values()
    assert all(axis["on"] and not axis["contradictions"] for axis in axes)
    assert (tmp_path / "r.json").is_file()
    assert client.state().enabled, "held afterwards"


def test_a_drive_is_checked_on_the_server_which_boots_it_again(client, server, stagectl):
    client.do(ask.Home())
    checked = stagectl("check", "2", "--server", server, "--json", "-")
    assert checked.returncode == 0, checked.stderr
    found = json.loads(checked.stdout)
    assert {each["verdict"] for each in found} <= {"pass", "differs", "not offered"}
    assert any(each["group"] == "power" or "enable" in each["check"] for each in found)
    assert not client.state().enabled
    moved = stagectl("check", "1", "--move", "--yes", "--server", server)
    assert moved.returncode == 0, moved.stderr
    assert "agrees" in moved.stdout
    job = client.begin(ask.Check(node=2))
    until(client, lambda s: s.what == "checking node 2")
    client.stop("enough")
    with pytest.raises(JobFailed, match="stopped by anna: enough"):
        client.wait(job)
    client.do(ask.Home())
    assert client.state().enabled


def test_a_run_may_believe_another_model_but_not_other_drives(client, server, stagectl, tmp_path):
    text = load_machine().text
    model = yaml.safe_load(text)
    model["axes"]["x"]["plant"]["mass"] *= 1.05
    (tmp_path / "twin.yaml").write_text(yaml.safe_dump(model, sort_keys=False))
    model["axes"]["x"]["limits"]["velocity"] /= 2
    (tmp_path / "other.yaml").write_text(yaml.safe_dump(model, sort_keys=False))
    (tmp_path / "r.yaml").write_text(RECIPE)
    run = ("run", tmp_path / "r.yaml", "--server", server, "--history", "none")
    done = stagectl(*run, "--machine", tmp_path / "twin.yaml", "--out", tmp_path / "with")
    assert done.returncode == 0, done.stderr
    recorded = read_recording(tmp_path / "with" / "recording.h5")
    assert recorded.machine == (tmp_path / "twin.yaml").read_text()
    assert client.state().queue[-1].machine == str(tmp_path / "twin.yaml")
    refused = stagectl(*run, "--machine", tmp_path / "other.yaml", "--out", tmp_path / "other")
    assert refused.returncode == 2
    assert "axis x: velocity" in refused.stderr
    assert "start a server with this file" in refused.stderr


@pytest.mark.slow
def test_a_calibration_is_run_by_the_server(server, stagectl, tmp_path):
    (tmp_path / "sites.yaml").write_text(
        "calibrate: four\nsites: [[0, 0], [0.02, 0], [0.02, 0.02], [0, 0.02]]\n"
    )
    made = stagectl("calibrate", tmp_path / "sites.yaml", "--server", server, "--out",
                   tmp_path / "run", "--history", tmp_path / "stage.db")  # fmt: skip
    assert made.returncode == 0, made.stderr
    assert "map 1 stored" in " ".join(made.stdout.split())


def test_a_second_server_of_the_same_name_is_refused(server, stagectl, tmp_path):
    second = stagectl("serve", "--simulate", "--name", server, "--data", tmp_path)
    assert second.returncode == 1
    assert f"a stage server '{server}' runs already" in second.stderr


def test_a_killed_server_comes_back_with_its_queue_and_starts_nothing(runtime, tmp_path):
    with serving(tmp_path, "--simulate") as process, Client(process.server) as client:
        number = queue(client, tmp_path / "run")
        waiting = client.ask(ask.QueueAdd(recipe=RECIPE, source="short.yaml"))["id"]
        until(client, lambda s: s.run is not None and s.run.done >= 1)
        process.kill()
        process.wait()
    with pytest.raises(NoServer):
        Client(process.server)
    with serving(tmp_path, "--simulate") as process, Client(process.server) as client:
        state = client.state()
        assert entry(state, number).status == "interrupted"
        assert entry(state, waiting).status == "waiting"
        assert (state.doing, state.run, state.queue_runs) == ("disabled", None, False)
    # ended at once, but not before the files of the killed run were made
    assert len(read_recording(tmp_path / "run" / "recording.h5")) > 100
    assert read_notes(tmp_path / "run" / "recording.h5").outcome == "killed"


def test_axes_are_not_held_for_ever_and_a_server_ends_in_order(runtime, tmp_path):
    with (
        serving(tmp_path, "--simulate", "--hold", "1") as process,
        Client(process.server) as client,
    ):
        client.do(ask.Home())
        assert client.state().hold_left <= 1.0
        until(client, lambda s: not s.enabled)
        wait_until(lambda: any("nothing to do for 1 s" in n.text for n in client.notices()))
        queue(client, tmp_path / "run")
        until(client, lambda s: s.run is not None and s.run.moves >= 2)
        process.send_signal(signal.SIGTERM)
        assert process.wait(LONG) == 0
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["outcome"] == "aborted"
    assert "the server was stopped" in summary["interrupted"]["reason"]


@pytest.mark.real_time
def test_lost_drives_are_an_alarm_and_a_dead_server_stops_them(
    runtime, stagectl, tmp_path, monkeypatch
):
    bus = "udp_multicast:239.74.163.79"
    machine = slow_machine(tmp_path, bus, monkeypatch)
    with drives_on(bus, machine) as drives:
        with (
            serving(tmp_path, "--machine", machine, "--bus", bus) as process,
            Client(process.server) as client,
        ):
            client.do(ask.Home())
            assert client.state().enabled
            drives.send_signal(signal.SIGSTOP)
            try:
                state = until(client, lambda s: s.alarms)
            finally:
                drives.send_signal(signal.SIGCONT)
            assert state.doing == "fault"
            assert state.alarms[0].advice
            client.ask(ask.Acknowledge(alarm=state.alarms[0].id))
            client.do(ask.Home(reset=True))
            assert until(client, lambda s: s.doing == "held").enabled
            process.kill()
            process.wait()
        time.sleep(1.0)
        look = stagectl("status", "--machine", machine, "--bus", bus, "--json", "-")
        assert look.returncode == 0, look.stderr
        assert look.stdout.count("OPERATION ENABLED") == 0
        assert look.stdout.count('"state"') == 2


def test_a_drive_that_goes_on_without_its_host_is_not_held(runtime, stagectl, tmp_path):
    machine = yaml.safe_load(load_machine().text)
    machine["axes"]["y"]["drive"]["unwatched_host"] = "accept"
    (tmp_path / "m.yaml").write_text(yaml.safe_dump(machine))
    refused = stagectl("serve", "--machine", tmp_path / "m.yaml", "--bus", "virtual:nowhere")
    assert refused.returncode == 2
    assert "unwatched_host" in refused.stderr
