"""What a run says of itself: verdicts, how it ended, and the same again from its recording."""

import io
import json
import re
import shlex
import sqlite3
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path

import pytest
from click.testing import CliRunner
from rich.console import Console

from stagectl.cli import cli
from stagectl.cli.outcome import render_outcome
from stagectl.errors import LimitsMissed
from stagectl.recipe import parse_recipe
from stagectl.run import (
    HostSettings,
    Listener,
    Remarks,
    RunRequest,
    SimulatedStage,
    execute,
    list_runs,
)
from stagectl.sequencer import Mode, SegmentDone
from tests.short_recipe import short_recipe
from tests.signals import as_in_a_terminal

PLACES = ((0.01, 0.0), (0.02, 0.01), (0.01, 0.02), (0.0, 0.01))
TIGHT = short_recipe(*PLACES) + "lot: L42\nwafer: W7\nlimits: {peak_error: 1 nm}\n"
WIDE = TIGHT.replace("1 nm", "1 mm")


def request_for(machine, text, folder, **other):
    """A run of a recipe on the virtual stage; `other`: of the request."""
    (folder / "r.yaml").write_text(text)
    recipe = parse_recipe(text, str(folder / "r.yaml"), machine)
    simulated = {"simulated": SimulatedStage(machine), **other}
    return RunRequest(recipe, machine, folder / "run", datetime.now(UTC), **simulated)


@pytest.fixture(scope="module")
def made(machine, tmp_path_factory):
    """Make a run of a recipe, stopped when `stop` sites are done; its folder and its result."""

    def go(text, stop=None, **other):
        request = request_for(machine, text, tmp_path_factory.mktemp("made"), **other)
        stops = []

        def event(happened):
            if isinstance(happened, SegmentDone) and happened.number == stop:
                stops[0]("stopped by the operator (Ctrl-C)")

        return execute(request, Listener(event=event, stoppable=stops.append)), request.folder

    return go


@pytest.fixture(scope="module")
def stopped(made):
    """A run of four sites that the operator stopped after two."""
    return made(WIDE, stop=2, remarks=Remarks("Ada", "first of the lot"))


def stagectl(*arguments):
    with as_in_a_terminal():
        return CliRunner().invoke(cli, list(map(str, arguments)))


def headline(folder):
    page = (folder / "report.html").read_text()
    return page.split('<p class="headline">')[1].split("</p>")[0]


def test_sites_and_wafer_are_judged_by_the_limits(made):
    for text, verdict, said in (
        (TIGHT, "fail", "Wafer W7 fails: 4 of 4 sites miss the limits."),
        (WIDE, "pass", "Wafer W7 passes: all 4 sites are within the limits."),
    ):
        result, folder = made(text)
        limits = json.loads((folder / "summary.json").read_text())["limits"]
        assert (limits["verdict"], limits["of"]) == (verdict, 4)
        assert [site["site"] for site in limits["sites"]] == [1, 2, 3, 4]
        assert all(site["passed"] == (verdict == "pass") for site in limits["sites"])
        assert limits["passed" if verdict == "pass" else "failed"] == 4
        assert headline(folder).startswith(said)
        assert ("interrupted" in result.summary) is False
    assert "limits" not in made(short_recipe(*PLACES))[0].summary


def test_a_complete_run_that_misses_its_limits_ends_with_4(tmp_path):
    (tmp_path / "r.yaml").write_text(TIGHT)
    done = stagectl("run", tmp_path / "r.yaml", "--simulate", "--out", tmp_path / "run")
    assert isinstance(done.exception, LimitsMissed)
    assert done.exception.exit_code == 4
    assert "4 of 4 sites miss the limits" in str(done.exception)
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["outcome"] == "completed"


def test_an_aborted_run_says_where_why_and_how_to_continue(stopped):
    result, folder = stopped
    told = result.summary["interrupted"]
    assert (told["unit"], told["done"], told["of"], told["at"]) == ("site", 2, 4, 3)
    seconds = result.summary["duration"]
    assert headline(folder).startswith(
        f"Ended at site 3 of 4 ({seconds:.1f} s): stopped by the operator (Ctrl-C). "
        "Wafer W7 incomplete: 2 of 4 sites judged, all within the limits."
    )
    words = shlex.split(told["resume"])
    assert words == [
        "stagectl", "run", str(folder.parent / "r.yaml"), "--simulate", "--history", "none",
        "--resume", str(folder),
    ]  # fmt: skip
    assert f"<code>{told['resume']}</code>" in (folder / "report.html").read_text()


def test_the_terminal_says_where_an_aborted_run_ended(stopped):
    seconds = stopped[0].summary["duration"]
    command = stopped[0].summary["interrupted"]["resume"]
    for width in (200, 80, 40):
        console = Console(width=width, record=True, file=io.StringIO())
        console.print(render_outcome(*stopped), crop=False)
        told = console.export_text()
        assert f"Ended at site 3 of 4 ({seconds:.1f} s)" in " ".join(told.split())
        assert f"to continue: {command}" in told.splitlines(), "a command is one line"


def test_the_command_continues_the_run_and_completes_the_verdict(stopped):
    result, folder = stopped
    words = shlex.split(result.summary["interrupted"]["resume"])
    rest = folder.parent / "rest"
    done = stagectl(*words[1:], "--out", rest)
    assert done.exit_code == 0, done.output
    summary = json.loads((rest / "summary.json").read_text())
    limits = summary["limits"]
    assert (limits["verdict"], limits["passed"]) == ("pass", 4)
    assert [site["site"] for site in limits["sites"]] == [1, 2, 3, 4]
    assert summary["resumed"] == {
        "run": str(folder), "started": result.summary["started"], "done": 2
    }  # fmt: skip
    assert (summary["operator"], summary["comment"]) == ("Ada", "first of the lot"), "kept"
    assert (summary["lot"], summary["wafer"]) == (result.summary["lot"], "W7")


def test_options_of_the_run_are_in_the_command_that_continues_it(made):
    result, _ = made(
        short_recipe(*PLACES),
        stop=1,
        retries=2,
        host=HostSettings(use_map=False),
        remarks=Remarks("Ada"),
    )
    words = shlex.split(result.summary["interrupted"]["resume"])
    assert words[4:-2] == ["--retries", "2", "--map", "none", "--history", "none"]


def test_report_makes_the_same_again(stopped):
    _, folder = stopped
    names = ("summary.json", "report.html")
    before = {name: (folder / name).read_bytes() for name in names}
    for name in names:
        (folder / name).unlink()
    done = stagectl("report", folder)
    assert done.exit_code == 0, done.output
    assert {name: (folder / name).read_bytes() for name in names} == before


def test_report_says_what_it_cannot_use(tmp_path):
    foreign = Path(__file__).parents[1] / "data" / "null-1.h5"
    for path, reason in (
        (tmp_path, "holds no recording.h5"), (tmp_path / "none", "no such run"),
        (foreign, "does not say how it was run"),
    ):  # fmt: skip
        done = stagectl("report", path)
        assert reason in str(done.exception)
        assert done.exception.exit_code == 2


@pytest.fixture(scope="module")
def killed(machine, tmp_path_factory, killed_at_its_second_site):
    folder = tmp_path_factory.mktemp("killed")
    request = request_for(machine, WIDE, folder, remarks=Remarks(operator="Grace"))
    killed_at_its_second_site(request)
    return request


def test_recover_writes_summary_and_report(killed):
    (listed,) = list_runs(killed.folder)
    assert (listed.outcome, listed.done, listed.of, listed.operator) == ("killed", 2, 4, "Grace")
    done = stagectl("recover", killed.folder)
    assert done.exit_code == 0, done.output
    summary = json.loads((killed.folder / "summary.json").read_text())
    assert (summary["outcome"], summary["wall_time"]) == ("killed", None)
    assert [site["site"] for site in summary["limits"]["sites"]] == [1, 2]
    assert len(summary["friction"]) > 4
    assert all(entry["gain"] for entry in summary["friction"])
    assert re.match(
        r"Ended after site 2 of 4 \(\d\.\d s\): the process was killed\.", headline(killed.folder)
    )
    assert summary["interrupted"]["resume"] in done.output


def test_a_run_that_never_reached_its_stage_resumes_nothing(machine, tmp_path):
    """Its summary still says what happened; `runs` lists it."""
    request = request_for(
        machine,
        WIDE,
        tmp_path,
        simulated=None,
        bus=("virtual", "nobody"),
        host=HostSettings(mode=Mode.NONE),
        remarks=Remarks(comment="nobody there"),
    )
    told = execute(request, Listener()).summary["interrupted"]
    assert (told["done"], told["at"], told["resume"]) == (0, None, None)
    (listed,) = list_runs(tmp_path)
    assert (listed.outcome, listed.comment, listed.simulated) == ("fault", "nobody there", False)
    assert "boot" in listed.reason


def test_runs_are_listed_with_what_is_known_of_them(stopped, killed, made, tmp_path):
    runs = tmp_path / "runs"
    runs.mkdir()
    for number, folder in enumerate((stopped[1], made(TIGHT, remarks=Remarks("Ada"))[1])):
        (runs / f"run-{number}").symlink_to(folder)
    (runs / "torn").mkdir()
    (runs / "torn" / "summary.json").write_text("{")
    (runs / "notes").mkdir()
    told = tmp_path / "told.json"
    done = stagectl("runs", runs, "--json", told)
    assert done.exit_code == 0, done.output
    listing = json.loads(told.read_text())
    assert (listing["format"], listing["version"]) == ("stagectl-runs", 1)
    listed = {Path(run["folder"]).name: run for run in listing["runs"]}
    assert set(listed) == {"run-0", "run-1", "torn"}
    first, second = listed["run-0"], listed["run-1"]
    assert (first["recipe"], first["lot"], first["wafer"]) == ("short", "L42", "W7")
    assert (first["operator"], first["comment"]) == ("Ada", "first of the lot")
    assert (first["outcome"], first["done"], first["of"]) == ("aborted", 2, 4)
    assert (first["verdict"], second["verdict"]) == ("incomplete", "fail")
    assert listed["torn"]["outcome"] == "unreadable"
    for words in ("Ada", "L42", "aborted"):
        assert words in done.output
    missing = stagectl("runs", tmp_path / "none")
    assert "none" in missing.output + str(missing.exception)


def test_operator_and_comment_are_kept(tmp_path):
    (tmp_path / "r.yaml").write_text(short_recipe((0.01, 0.0)))
    where = str(tmp_path / "stage.db")
    run = ("run", tmp_path / "r.yaml", "--simulate", "--history", where, "--out", tmp_path / "run")
    done = stagectl(*run, "--operator", "Ada L.", "--comment", "chuck 2")
    assert done.exit_code == 0, done.output
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert (summary["operator"], summary["comment"]) == ("Ada L.", "chuck 2")
    page = (tmp_path / "run" / "report.html").read_text()
    assert "<dd>Ada L.</dd>" in page
    assert "<dd>chuck 2</dd>" in page
    with closing(sqlite3.connect(where)) as database:
        assert database.execute("SELECT operator, comment FROM run").fetchall() == [
            ("Ada L.", "chuck 2")
        ]
