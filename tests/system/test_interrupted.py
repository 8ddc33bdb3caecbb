"""Ctrl-C in the moments in which no command runs: amid imports, and while the process ends.

The process sends the signal to itself, at a named moment.
"""

import subprocess
import sys

import pytest

from tests.short_recipe import short_recipe
from tests.signals import listening

HEAD = """
import atexit, os, runpy, signal, sys

def interrupt(*_):
    os.kill(os.getpid(), signal.SIGINT)

def amid_import(name, call=interrupt):
    sys.addaudithook(lambda event, args: event == "import" and args[0] == name and call())

class AtTheVeryEnd:
    def __init__(self):
        # what it calls is gone from its modules by then
        self.call = (os.kill, os.getpid(), signal.SIGINT)

    def __del__(self):
        kill, process, number = self.call
        kill(process, number)

"""
TAIL = """
sys.argv = ["stagectl", *sys.argv[1:]]
runpy.run_module("stagectl", run_name="__main__", alter_sys=True)
"""


def interrupted(moment, *arguments):
    return subprocess.run(
        [sys.executable, "-c", HEAD + moment + TAIL, *arguments],
        capture_output=True, text=True, check=False, timeout=100, preexec_fn=listening,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("module", "command"),
    [("click", "--help"), ("stagectl.errors", "--help"), ("pydantic", "bus-budget")],
)
def test_amid_an_import(module, command):
    done = interrupted(f"amid_import({module!r})", command)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "stagectl: stopped\n")


@pytest.mark.parametrize(
    ("arguments", "code"), [(["bus-budget"], 130), (["run", "absent.yaml", "--dry-run"], 2)]
)
def test_while_the_process_ends_what_was_said_stays_said(arguments, code):
    done = interrupted("amid_import('click', lambda: atexit.register(interrupt))", *arguments)
    assert done.returncode == code
    assert done.stderr.splitlines()[-1] == "stagectl: stopped"
    assert "Traceback" not in done.stderr
    assert "ms" in done.stdout if code == 130 else "absent.yaml" in done.stderr


def test_when_nothing_is_left_to_stop_the_exit_code_is_that_of_the_command():
    done = interrupted("sys.last = AtTheVeryEnd()", "--version")
    assert (done.returncode, done.stderr) == (0, "")
    assert "stagectl" in done.stdout


def test_a_job_in_the_background_is_not_stopped():
    done = interrupted(
        "signal.signal(signal.SIGINT, signal.SIG_IGN); amid_import('click')", "--version"
    )
    assert (done.returncode, done.stderr) == (0, "")


def test_a_run_is_stopped_by_the_operator_while_it_reads_what_others_parse(tmp_path):
    recipe = tmp_path / "short.yaml"
    recipe.write_text(short_recipe((0.001, 0.001)))
    moment = """
def opened(event, args):
    handler = getattr(signal.getsignal(signal.SIGINT), "__module__", "")
    ours = handler == "stagectl.cli.signals"
    if event == "open" and str(args[0]).endswith(".eds") and ours:
        interrupt()

sys.addaudithook(opened)
"""
    done = interrupted(moment, "run", str(recipe), "--simulate", "--out", str(tmp_path / "out"))
    assert done.returncode == 130
    assert "stagectl: stopped by the operator (Ctrl-C)" in done.stderr
    assert "aborted" in (tmp_path / "out" / "summary.json").read_text()
