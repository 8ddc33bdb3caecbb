"""The command as users meet it: help, dry run, bad input, Ctrl-C, SIGKILL."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import pytest

from stagectl.cli import COMMANDS
from stagectl.config import load_machine
from stagectl.store import read_recording
from tests.processes import buses, drives_on, slow_machine, start
from tests.short_recipe import short_recipe
from tests.waiting import wait_until

ROOT = Path(__file__).parents[2]
RECIPE = ROOT / "recipes" / "inspection-20.yaml"
SITES = "calibrate: c\nsites: [[0, 0], [0.01, 0], [0.02, 0], [0.03, 0]]\n"
DATA = ROOT / "tests" / "data"
SHORT = short_recipe((0.001, 0.001), (0.003, 0.002))


@pytest.fixture
def short(tmp_path):
    """A recipe that is soon over."""
    path = tmp_path / "short.yaml"
    path.write_text(SHORT)
    return path


def test_help_is_light():
    code = (
        "import sys\n"
        "sys.argv = ['stagectl', '--help']\n"
        "from stagectl.cli import main\n"
        "try:\n    main()\nexcept SystemExit:\n    pass\n"
        "heavy = {'numba', 'scipy', 'h5py', 'numpy', 'can', 'canopen', 'pydantic', 'rich'}\n"
        "sys.stderr.write(' '.join(sorted(heavy & set(sys.modules))))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "run" in done.stdout
    assert done.stderr == ""


@pytest.mark.parametrize(
    "command", [[], *([name] for name in COMMANDS), ["gap", "measure"], ["gap", "compare"]]
)
def test_every_command_has_help(stagectl, command):
    done = stagectl(*command, "--help")
    assert done.returncode == 0
    assert "Usage:" in done.stdout
    assert "\\b" not in done.stdout  # click's mark for "do not wrap", which is no text


def test_examples_in_the_help_stand_on_lines_of_their_own(stagectl):
    lines = stagectl("run", "--help").stdout.splitlines()
    assert "    stagectl run recipes/inspection-20.yaml --simulate" in lines


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_script(stagectl, shell):
    done = stagectl("completion", shell)
    assert done.returncode == 0
    assert "_STAGECTL_COMPLETE" in done.stdout


def test_run_and_json(process, short, tmp_path):
    done = process("run", short, "--simulate", "--out", tmp_path / "a", "--json", "-")
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert summary["outcome"] == "completed"
    assert "Completed." in done.stderr
    assert {p.name for p in (tmp_path / "a").iterdir()} == {
        "recording.h5", "summary.json", "report.html", "bus.asc",
    }  # fmt: skip


def test_dry_run_touches_nothing(stagectl, tmp_path):
    done = stagectl("run", RECIPE, "--dry-run", "--json", tmp_path / "plan.json", cwd=tmp_path)
    assert done.returncode == 0
    assert done.stderr == ""
    plan = json.loads((tmp_path / "plan.json").read_text())
    assert plan["sites"] == 20
    assert plan["moves"] == {"macro": 20, "micro": 20}
    assert "dry run" in done.stdout
    assert [p.name for p in tmp_path.iterdir()] == ["plan.json"]


def test_a_dry_run_checks_what_the_run_checks(stagectl, short, tmp_path):
    """In the same words, and without writing anything."""
    text = load_machine().text
    effect = tmp_path / "effect.yaml"
    effect.write_text(text.replace("  y:", "    effects: [{effect: gremlins}]\n  y:", 1))
    eds = tmp_path / "eds.yaml"
    eds.write_text(text.replace("    node: 1", "    node: 1\n    eds: torn.eds", 1))
    (tmp_path / "torn.eds").write_text("[DeviceInfo\n")
    warm = tmp_path / "warm.yaml"
    warm.write_text(text + "temperature: {plugin: nobody}\n")
    (tmp_path / "old.db").write_text("my notes\n" * 1000)
    (tmp_path / "file").touch()
    before = sorted(tmp_path.iterdir())
    for options, reason in (
        (["--simulate", effect], "gremlins"),
        (["--simulate", "--machine", eds, "--out", tmp_path / "o"], "torn.eds"),
        (
            ["--simulate", "--machine", warm],
            "plug-in 'nobody' is not installed",
        ),
        (["--simulate", "--history", tmp_path / "old.db"], "not an SQLite file"),
        (["--simulate", "--out", tmp_path / "file" / "o"], "is not a folder"),
    ):
        dry = stagectl("run", short, *options, "--dry-run", cwd=tmp_path)
        wet = stagectl("run", short, *options, cwd=tmp_path)
        assert (dry.returncode, dry.stdout) == (2, "")
        assert reason in dry.stderr
        assert wet.stderr.splitlines()[-1] == dry.stderr.splitlines()[-1]
        assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["run", "missing.yaml", "--simulate"], "missing.yaml"),
        (["run", RECIPE, "--machine", "missing.yaml"], "missing.yaml"),
        (["run", RECIPE, "--compensation", "oracle"], "oracle"),
        (["run", RECIPE, "--simulate", "--bus", "virtual:x"], "--bus"),
        (["run", RECIPE, "--bus", "virtual"], "INTERFACE:CHANNEL"),
        (["run", RECIPE], "no bus given: use --simulate, or --bus"),
        (["run", "--simulate", RECIPE], "as TRUTH"),
        (["gap", "measure", "missing.h5"], "missing.h5"),
        (["gap", "measure", RECIPE], "inspection-20.yaml"),
        (["gap", "diagnose", RECIPE], "inspection-20.yaml"),
    ],
)
def test_bad_arguments_are_one_line(stagectl, tmp_path, arguments, word):
    done = stagectl(*arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert word in done.stderr
    assert "Traceback" not in done.stderr
    assert not list(tmp_path.iterdir()), "no folder of a run"


def test_gap_measure(stagectl, tmp_path):
    done = stagectl("gap", "measure", DATA / "null-3.h5", "--json", tmp_path / "gap.json")
    assert done.returncode == 0, done.stderr
    report = json.loads((tmp_path / "gap.json").read_text())
    assert (report["format"], report["version"]) == ("stagectl-gap-report", 2)
    for axis in ("x", "y"):
        assert report["gap"][axis]["position"]["nominal"] <= 0.15e-6
        assert report["gap"][axis]["force"]["nominal"] <= 0.14
        assert set(report["gap"][axis]["position"]) == {"nominal", "floor", "unit"}


@pytest.mark.parametrize(
    ("command", "bus"),
    [
        (["run", RECIPE], "socketcan:nosuchcan9"),
        (["run", RECIPE], "nosuch:can0"),
        (["calibrate", "sites.yaml"], "socketcan:nosuchcan9"),
        (["scan"], "socketcan:nosuchcan9"),
        (["status"], "nosuch:can0"),
        (["enable"], "socketcan:nosuchcan9"),
        (["home"], "socketcan:nosuchcan9"),
        (["jog", "x", "1mm"], "socketcan:nosuchcan9"),
        (["check", "1"], "socketcan:nosuchcan9"),
        (["sim"], "socketcan:nosuchcan9"),
    ],
    ids=lambda value: " ".join(map(str, value[:1])) if isinstance(value, list) else value,
)
def test_a_bus_that_cannot_be_opened_is_unusable_input_and_leaves_nothing(
    stagectl, tmp_path, command, bus
):
    (tmp_path / "sites.yaml").write_text(SITES)
    done = stagectl(*command, "--bus", bus, cwd=tmp_path)
    assert done.returncode == 2, done.stderr
    assert done.stderr.splitlines()[-1].startswith(f"stagectl: bus {bus}: cannot open: ")
    assert [path.name for path in tmp_path.iterdir()] == ["sites.yaml"]


def test_drives_that_do_not_answer_leave_the_bus_log_and_no_row(stagectl, short, tmp_path):
    """Nor does a map command then ask which stage is meant."""
    machine = tmp_path / "m.yaml"
    machine.write_text(load_machine().text)
    simulated = ("--simulate", "--history", tmp_path / "stage.db")
    assert stagectl("run", short, *simulated, "--out", tmp_path / "v").returncode == 0
    out, history = tmp_path / "out", ("--history", tmp_path / "stage.db")
    done = stagectl("run", short, "--bus", "virtual:nobody", "--out", out, *history)
    assert done.returncode == 3, done.stderr
    assert json.loads((out / "summary.json").read_text())["outcome"] == "fault"
    assert " 1  0 " in (out / "bus.asc").read_text()  # the NMT reset that nobody answered
    shown = stagectl("map", "history", *history)
    assert (shown.returncode, shown.stderr) == (0, "")


def start_long(folder):
    """A run in the middle of its many moves."""
    (folder / "long.yaml").write_text(short_recipe(*[(0.03, 0.03), (-0.03, -0.03)] * 1000))
    process = start("run", "long.yaml", "--simulate", "--out", "out", cwd=folder)
    journal = folder / "out" / "recording.journal"
    wait_until(
        lambda: (
            process.poll() is not None
            or (
                journal.exists() and journal.stat().st_size > 300_000  # 1000 samples and more
            )
        )
    )
    assert process.poll() is None, process.communicate()
    return process


def test_ctrl_c_stops_and_keeps_what_was_recorded(tmp_path):
    process = start_long(tmp_path)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=100)
    assert process.returncode == 130
    assert "stopped by the operator" in errors
    assert "Traceback" not in errors
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["outcome"] == "aborted"
    recording = read_recording(tmp_path / "out" / "recording.h5")
    assert len(recording) > 1000
    for signals in recording.axes.values():  # a controlled stop: at rest at the end
        assert abs(signals.position_demand[-1] - signals.position_demand[-2]) <= 1e-9
    assert not (tmp_path / "out" / "recording.journal").exists()


def test_nothing_is_lost_when_killed(stagectl, tmp_path):
    process = start_long(tmp_path)
    process.kill()
    process.communicate(timeout=100)
    assert not (tmp_path / "out" / "recording.h5").exists()
    done = stagectl("recover", tmp_path / "out")
    assert done.returncode == 0
    assert "recording.h5" in done.stdout
    assert len(read_recording(tmp_path / "out" / "recording.h5")) > 1000


@pytest.mark.real_time
@pytest.mark.parametrize("bus", buses("239.74.163.79"))
def test_a_run_in_real_time_beside_the_drives_process(process, tmp_path, monkeypatch, bus):
    machine = slow_machine(tmp_path, bus, monkeypatch)
    recipe = tmp_path / "recipe.yaml"
    recipe.write_text(short_recipe((0.001, 0.001), (0.003, 0.002), slow=True))
    with drives_on(bus, machine):
        done = process(
            "run", recipe, "--machine", machine, "--bus", bus, "--out", tmp_path / "out",
            "--json", "-",
        )  # fmt: skip
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert summary["outcome"] == "completed"
    assert not summary["simulated"]
    assert len(read_recording(tmp_path / "out" / "recording.h5").moves) == 4


def test_a_terminal_that_cannot_show_everything(process, short, tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONIOENCODING", "ascii")
    monkeypatch.setenv("COLUMNS", "40")
    done = process("run", short, "--simulate", "--out", tmp_path / "a")
    assert done.returncode == 0, done.stderr
    row = next(line for line in done.stdout.splitlines() if "micro" in line and "updated" in line)
    assert row.replace("|", " ").split()[:4] == ["x", "micro", "updated", "2"]


def test_a_closed_pipe_does_not_stop_a_run(short, tmp_path):
    """The first site says that it did not settle; nobody reads it."""
    read, write = os.pipe()
    os.close(read)
    options = ("--simulate", "--friction-scale", "0.5", "--out", tmp_path)
    start("run", short, *options, stdout=write, stderr=subprocess.DEVNULL).wait(500)
    os.close(write)
    assert json.loads((tmp_path / "summary.json").read_text())["outcome"] == "completed"


def test_ctrl_c_before_anything_moves(tmp_path):
    bus = f"virtual:nobody-{os.getpid()}"
    process = start("run", RECIPE, "--bus", bus, "--out", tmp_path / "out")
    wait_until((tmp_path / "out" / "bus.frames").exists)
    time.sleep(0.3)  # nobody answers: it waits for boot-up messages
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=100)
    assert process.returncode == 130
    assert "stopped by the operator" in errors
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["outcome"] == "aborted"


def test_an_earlier_run_is_put_aside(stagectl, short, tmp_path):
    out = tmp_path / "out"
    assert stagectl("run", short, "--simulate", "--out", out).returncode == 0
    first = (out / "recording.h5").read_bytes()
    refused = stagectl("run", short, "--bus", "socketcan:nosuchcan9", "--out", out)
    assert refused.returncode == 2
    assert (out / "recording.h5").read_bytes() == first
    done = stagectl("run", short, "--bus", "virtual:nobody", "--out", out)
    assert done.returncode == 3
    assert not (out / "recording.h5").exists()
    assert (out / "previous" / "recording.h5").read_bytes() == first


def test_gap_compare(stagectl, tmp_path):
    heavy = tmp_path / "heavy.yaml"
    text = load_machine().text
    heavy.write_text(text.replace("mass: 8.0", "mass: 8.8"))
    (tmp_path / "wafer-xy.yaml").write_text(text)
    done = stagectl(
        "gap", "compare", heavy, tmp_path / "wafer-xy.yaml", DATA / "null-2.h5", "--json", "-"
    )
    report = json.loads(done.stdout)
    assert report["gap_closed"] > 0.95
    assert report["gap"]["x"]["force"]["explained"] < 0.14 < report["gap"]["x"]["force"]["nominal"]


@pytest.mark.parametrize(
    "command",
    [
        ["run", RECIPE, "--simulate", "--out", "{}/run"],
        ["run", RECIPE, "--simulate", "--out", "{out}", "--history", "{}/stage.db"],
        ["run", RECIPE, "--dry-run", "--json", "{}/plan.json"],
        ["calibrate", "{sites}", "--simulate", "--out", "{}/run"],
        ["paper", "--out", "{}/page.md"],
        ["map", "show", "--history", "{}/stage.db"],
        ["recover", "{}/run"],
        ["replay", "{}/run"],
    ],
)
def test_a_folder_that_cannot_be_used_is_unusable_input(stagectl, tmp_path, command):
    (tmp_path / "file").touch()
    (tmp_path / "sites.yaml").write_text(SITES)
    names = {"out": tmp_path / "out", "sites": tmp_path / "sites.yaml"}
    done = stagectl(*(str(part).format(tmp_path / "file", **names) for part in command))
    assert done.returncode == 2, done.stderr
    assert str(tmp_path / "file") in done.stderr
    assert len([line for line in done.stderr.splitlines() if line.startswith("stagectl: ")]) == 1


def test_a_message_has_no_control_characters(stagectl, tmp_path):
    with h5py.File(tmp_path / "r.h5", "w") as file:
        file.attrs.update(format="stagectl-recording", version="1\n\x1b[31m2")
    done = stagectl("gap", "measure", tmp_path / "r.h5")
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert line.isprintable()


def test_ctrl_c_in_a_finalizer_is_not_lost():
    """Python prints what a finalizer raises, and goes on."""
    script = """
import os, signal
from stagectl.__main__ import _interrupt
class Bus:
    def __del__(self):
        os.kill(os.getpid(), signal.SIGINT)
signal.signal(signal.SIGINT, _interrupt)
del [Bus()][0]
print("went on")
"""
    ended = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=False
    )
    assert (ended.returncode, ended.stdout, ended.stderr) == (130, "", "stagectl: stopped\n")
