"""`stagectl observer`: measuring, designing, and what a run makes of a measurement."""

import json
import re

import pytest
from click.testing import CliRunner

from benchmarks.shared.other_stages import with_gains
from hil_sim.bus import World
from hil_sim.stage import VirtualStage
from stagectl.cli import cli
from stagectl.config import load_machine, stage_settings
from stagectl.errors import Aborted
from tests.unit.stagectl.run.whole import OVER_CURRENT, SITES


def call(*arguments, **options):
    return CliRunner().invoke(cli, [str(a) for a in arguments], **options)


MACHINE = load_machine().text


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """What is said of the virtual stage as it is measured, and the folder with it."""
    folder = tmp_path_factory.mktemp("measured")
    (folder / "m.yaml").write_text(MACHINE)
    out = ("--out", folder / "v.json", "--html", folder / "v.html", "--json", "-")
    done = call("observer", "--measure", "--machine", folder / "m.yaml", "--simulate", *out)
    assert done.exit_code == 0, done.output
    return done, folder


@pytest.fixture
def files(tmp_path, monkeypatch):
    """A folder with a machine file and a recipe."""
    (tmp_path / "m.yaml").write_text(MACHINE)
    (tmp_path / "r.yaml").write_text(SITES)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_virtual_stage_is_measured(measured):
    done, folder = measured
    x = json.loads(done.stdout)["axes"]["x"]
    assert x["contradictions"] == []
    assert x["on"]
    assert x["measured"]["gain"] > 2.0
    assert "Axis x" in (folder / "v.html").read_text()
    assert not (folder / "m.response.json").exists()
    given = ("--measurement", folder / "v.json", "--json", "-")
    again = call("observer", "--machine", folder / "m.yaml", *given)
    assert json.loads(again.stdout)["axes"] == json.loads(done.stdout)["axes"]


@pytest.fixture
def bus(machine):
    """Drives on a bus in virtual time, as `--bus` names it."""
    world = World("observer-command")
    VirtualStage(stage_settings(machine), 1).attach(world)
    yield f"lockstep:{world.name}"
    del world


def test_a_stage_on_a_bus_is_measured_after_a_question(files, bus):
    refused = call("observer", "--measure", "--machine", "m.yaml", "--bus", bus, input="n\n")
    assert isinstance(refused.exception, Aborted)
    assert "x: from -0.003 to 31.7" in refused.output
    assert not (files / "m.response.json").exists()
    done = call("observer", "--measure", "--machine", "m.yaml", "--bus", bus, input="y\n")
    assert done.exit_code == 0, done.output
    kept = json.loads((files / "m.response.json").read_text())
    assert kept["axes"]["x"]["drive"]["vendor"] is not None
    shown = call("observer", "--machine", "m.yaml")
    assert "as measured on 20" in shown.output


def test_without_a_measurement_the_file_is_designed_from_and_that_is_said(files):
    shown = call("observer", "--machine", "m.yaml")
    assert shown.exit_code == 0
    assert "not measured" in " ".join(shown.output.split())


@pytest.mark.parametrize(
    "options", ["--yes", "--out a.json", "--html a.html", "--measure --measurement a.json"]
)
def test_options_that_do_not_go_together(files, options):
    assert call("observer", "--machine", "m.yaml", *options.split()).exit_code == 2


def observers(folder):
    return json.loads((folder / "summary.json").read_text())["observer"]


def test_a_run_measures_the_virtual_stage_or_takes_what_is_given(files, measured):
    run = ("run", "r.yaml", "--machine", "m.yaml", "--simulate")
    done = call(*run, "--out", "a")
    assert done.exit_code == 0, done.output
    assert all(axis["on"] for axis in observers(files / "a").values())
    assert call("replay", "a").exit_code == 0
    given = call(*run, "--measurement", measured[1] / "v.json", "--out", "b")
    assert given.exit_code == 0, given.output
    assert observers(files / "b") == observers(files / "a")


def test_a_run_on_a_bus_has_no_observer_unless_measured(files, bus):
    done = call("run", "r.yaml", "--machine", "m.yaml", "--bus", bus, "--out", "a")
    assert done.exit_code == 0, done.output
    said = " ".join(done.output.split())
    assert "axes x, y: no observer: not measured; measure with: stagectl observer" in said
    assert not any(axis["on"] for axis in observers(files / "a").values())
    trusting = MACHINE.replace("node: 1\n", "node: 1\n    observer: trust\n")
    (files / "m.yaml").write_text(trusting)
    trusted = call("run", "r.yaml", "--machine", "m.yaml", "--bus", bus, "--out", "b")
    assert trusted.exit_code == 0, trusted.output
    assert observers(files / "b")["x"]["on"]
    assert not observers(files / "b")["y"]["on"]


SLOW = """\
recipe: slow
macro: {velocity: 0.01, acceleration: 0.5, jerk: 50}
micro: {velocity: 0.01, acceleration: 0.2, jerk: 20.0}
settle: {window: 5.0e-8, hold: 0.005, timeout: 0.15}
moves: [{to: [0.004, 0.004]}, {to: [0, 0]}, {to: [0.004, 0.004]}]
"""


@pytest.fixture
def changed(machine, request):
    """A bus with drives whose gains are half of the machine file's; drive y fails in time."""
    world = World(request.node.name)
    soft = with_gains(machine, dict.fromkeys(("kp", "ki", "kd"), 0.5))
    drives = VirtualStage(stage_settings(soft), 1)
    drives.attach(world)

    def fail(after_ns):
        world.at(world.now_ns + after_ns, lambda: drives.drives[1].inject_fault(OVER_CURRENT))

    return f"lockstep:{world.name}", fail


def watched(folder):
    """Axis -> whether its observer is on or why not; which the watchdog took out."""
    summary = json.loads((folder / "summary.json").read_text())
    observers = {name: axis.get("reason", axis["on"]) for name, axis in summary["observer"].items()}
    return observers, {e["axis"] for e in summary.get("watchdog", []) if e["out"]}


@pytest.mark.slow
def test_an_observer_that_is_out_stays_out_on_a_real_stage_until_it_is_measured(
    files, bus, changed
):
    where, fail = changed
    (files / "slow.yaml").write_text(SLOW)
    run = ("run", "slow.yaml", "--machine", "m.yaml", "--bus")
    measured = call("observer", "--measure", "--yes", "--machine", "m.yaml", "--bus", bus)
    assert measured.exit_code == 0, measured.output
    fail(3_500_000_000)
    ended = call(*run, where, "--out", "a")
    assert "over-current" in str(ended.exception)
    assert watched(files / "a") == ({"x": True, "y": True}, {"x", "y"})
    assert "(m.observer-out.json) until the stage is measured" in " ".join(ended.output.split())
    reset = call("enable", "--machine", "m.yaml", "--bus", where, "--hold", "0", "--reset")
    assert reset.exit_code == 0, reset.output
    resumed = call(*run, where, "--resume", "a", "--out", "b")
    assert resumed.exit_code == 0, resumed.output
    observers, found = watched(files / "b")
    assert found == set()
    assert all("the observer fed an oscillation" in reason for reason in observers.values())
    again = call("observer", "--measure", "--yes", "--machine", "m.yaml", "--bus", where)
    assert again.exit_code == 0, again.output
    gains = re.findall(r"kp, ki and kd are ([0-9.]+) of", " ".join(again.output.split()))
    assert [float(gain) for gain in gains] == pytest.approx([0.5, 0.5], rel=0.05)
    assert call(*run, where, "--out", "c").exit_code == 0
    assert watched(files / "c") == ({"x": True, "y": True}, set())


@pytest.mark.slow
def test_an_observer_that_is_out_is_replayed_and_begins_afresh_on_a_virtual_stage(files, measured):
    (files / "slow.yaml").write_text(SLOW)
    (files / "faults.yaml").write_text(
        "faults: [{fault: drive, axis: y, error: over_current, at: 3.5 s}]\n"
    )
    soft = re.sub(r"\b(k[pid]): ([0-9.]+)", lambda m: f"{m[1]}: {float(m[2]) / 2}", MACHINE)
    (files / "soft.yaml").write_text(soft)
    run = ("run", "slow.yaml", "--machine", "m.yaml", "--simulate", "soft.yaml")
    given = ("--measurement", measured[1] / "v.json", "--faults", "faults.yaml")
    ended = call(*run, *given, "--out", "a")
    assert "over-current" in str(ended.exception)
    assert watched(files / "a") == ({"x": True, "y": True}, {"x", "y"})
    assert not (files / "m.observer-out.json").exists()
    assert call("replay", "a").exit_code == 0
    resumed = call(*run, "--resume", "a", "--out", "b")
    assert resumed.exit_code == 0, resumed.output
    assert watched(files / "b") == ({"x": True, "y": True}, {"x", "y"})
    assert call("replay", "b").exit_code == 0
