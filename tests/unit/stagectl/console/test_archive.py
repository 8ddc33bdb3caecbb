"""Runs, diagnoses, recipes and the commands run beside the stage."""

import asyncio
import json
import time

import pytest

from stagectl.console.archive import Archive
from stagectl.console.folder import NoSuchFile
from stagectl.console.gate import Addresses
from stagectl.console.jobs import Jobs
from stagectl.console.recipes import Recipes
from stagectl.errors import StagectlError
from tests.unit.stagectl.run.whole import write_summary


def test_runs_come_with_their_pages_the_latest_first(tmp_path):
    write_summary(tmp_path / "old", started="2026-01-01T00:00:00+00:00")
    write_summary(tmp_path / "new", started="2026-01-02T00:00:00+00:00")
    (tmp_path / "new" / "report.html").write_text("")
    (tmp_path / "elsewhere").symlink_to(tmp_path / "old")
    runs = Archive(tmp_path).runs()
    assert [(run["folder"], run["pages"]) for run in runs] == [
        ("new", ["report.html"]),
        ("old", []),
    ]
    json.dumps(runs)
    assert Archive(tmp_path / "none").runs() == []


def test_a_diagnosis_writes_into_a_folder_of_its_own(tmp_path):
    (tmp_path / "run-1").mkdir()
    (tmp_path / "run-1" / "recording.h5").write_bytes(b"")
    folder, arguments = Archive(tmp_path).diagnosis(["run-1"])
    assert folder.parent == tmp_path / "gaps"
    assert arguments[:3] == ["gap", "diagnose", str(tmp_path / "run-1" / "recording.h5")]
    assert all(str(folder) in arguments[arguments.index(key) + 1] for key in ("--html", "--twin"))
    assert Archive(tmp_path).gaps() == [{"folder": folder.name, "files": []}]


def test_only_two_recorded_runs_are_compared(tmp_path):
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
    (tmp_path / "a" / "recording.h5").write_bytes(b"")
    with pytest.raises(NoSuchFile):
        Archive(tmp_path).compare_command("a", "b")
    (tmp_path / "b" / "recording.h5").write_bytes(b"")
    files = [str(tmp_path / name / "recording.h5") for name in ("a", "b")]
    assert Archive(tmp_path).compare_command("a", "b")[:4] == ["gap", "compare", *files]


def test_recipes_are_those_of_the_folder_and_the_packaged_ones(tmp_path):
    (tmp_path / "mine.yaml").write_text("recipe: mine\n")
    (tmp_path / "sites.yaml").write_text("calibrate: sites\n")
    (tmp_path / "inspection-20.yaml").write_text("recipe: my own\n")
    recipes = Recipes(tmp_path)
    assert recipes.names() == ["inspection-20.yaml", "mine.yaml"]
    assert recipes.read("inspection-20.yaml") == "recipe: my own\n"
    assert Recipes(None).names() == ["inspection-20.yaml"]
    assert recipes.names("calibrate") == ["sites.yaml", "calibration-9.yaml"]
    assert recipes.path("sites.yaml", "calibrate") == tmp_path / "sites.yaml"
    with pytest.raises(NoSuchFile):
        recipes.path("sites.yaml")


def test_commands_have_the_lowest_priority_and_one_line_of_failure():
    async def both():
        jobs = Jobs()
        said = await jobs.ask(["--version"])
        with pytest.raises(StagectlError, match="No such command"):
            await jobs.ask(["no-such-command"])
        await jobs.close()
        return said

    assert "stagectl" in asyncio.run(both())


def test_a_long_command_can_be_cancelled_and_is_the_only_one(tmp_path):
    async def cancelled():
        jobs = Jobs()
        jobs.begin("a", tmp_path, ["monitor", "--bus", "virtual:console-test"])
        with pytest.raises(StagectlError, match="under way: a"):
            jobs.begin("b", tmp_path, ["--version"])
        deadline = time.monotonic() + 60
        while jobs.latest.ended is None and time.monotonic() < deadline:
            jobs.cancel()
            await asyncio.sleep(0.05)
        await jobs.close()
        return jobs.latest

    job = asyncio.run(cancelled())
    assert job.ended is not None
    assert job.code != 0


def test_addresses_of_the_page():
    here = Addresses.of("127.0.0.1", 8402, ["https://stage.example"])
    assert {"localhost:8402", "[::1]:8402", "stage.example"} <= here.hosts
    assert "https://stage.example" in here.origins
    assert "http://stage.example" not in here.origins
    assert Addresses.of("192.0.2.1", 80, ()).hosts == {"192.0.2.1:80"}
