"""`stagectl calibrate` and `stagectl map` as they are used: measured, killed, gone on with."""

import csv
import json
import re
import shutil
from datetime import UTC, datetime

import pytest
from click.testing import CliRunner

from stagectl.calibration import load_calibration
from stagectl.cli import cli
from stagectl.config.machine.file import load_machine
from stagectl.errors import StagectlError
from stagectl.history import StageKey, open_history
from stagectl.maps import map_versions
from stagectl.run import RunRequest, SimulatedStage
from stagectl.store import read_notes
from tests.short_recipe import short_recipe

STAGE = StageKey("wafer-xy", True)
SITES = "calibrate: weekly\nsites: [[0, 0], [0.02, 0], [0.02, 0.02], [0, 0.02]]\n"
RECIPE = short_recipe((0.01, 0.01), (0.015, 0.01))


def stagectl(*arguments, code=0):
    """Run a command in this process; what it says. `code`: None where it is used wrongly."""
    result = CliRunner().invoke(cli, [str(a) for a in arguments])
    if code is None:
        assert result.exit_code == 2, result.output
        return result.output
    if code == 0:
        assert result.exit_code == 0, result.output + repr(result.exception)
        return result.output
    assert isinstance(result.exception, StagectlError), result.output
    assert result.exception.exit_code == code
    return str(result.exception)


def test_a_dry_run_checks_what_the_run_checks_and_writes_nothing(tmp_path):
    (tmp_path / "sites.yaml").write_text(SITES)
    truth = tmp_path / "truth.yaml"
    text = load_machine().text
    truth.write_text(text.replace("  y:", "    effects: [{effect: gremlins}]\n  y:", 1))
    run = ("calibrate", tmp_path / "sites.yaml", "--out", tmp_path / "run", "--dry-run")
    assert "gremlins" in stagectl(*run, "--simulate", truth, code=2)
    history = ("--history", tmp_path / "stage.db")
    told = tmp_path / "told.json"
    said = stagectl(*run, "--simulate", "--due", *history, "--json", told)
    assert "would visit (20, 0) mm" in said
    assert "virtual bus" not in said, "nothing was to move"
    planned = json.loads(told.read_text())
    places = [[0, 0], [0.02, 0], [0.02, 0.02], [0, 0.02]]
    assert planned["would_visit"] == [*places, places[0]]
    assert (planned["format"], planned["map"]) == ("stagectl-calibration", None)
    assert planned["sites"] == []
    assert {path.name for path in tmp_path.iterdir()} == {"sites.yaml", "truth.yaml", told.name}


def test_too_few_sites_for_a_map_are_refused_before_anything_moves(tmp_path):
    """Two of these four are one place."""
    few = tmp_path / "few.yaml"
    few.write_text("calibrate: few\nsites: [[0, 0], [0.001, 0], [0.02, 0.02], [0, 0.02]]\n")
    run = ("calibrate", few, "--simulate", "--out", tmp_path / "run")
    for more in ((), ("--dry-run",)):
        said = stagectl(*run, *more, code=2)
        assert "few.yaml: sites: 3 make no map, those in the history included; it takes 4" in said
    assert [path.name for path in tmp_path.iterdir()] == ["few.yaml"]


@pytest.fixture(scope="module")
def killed(machine, tmp_path_factory, killed_at_its_second_site):
    """A calibration of four sites, killed behind the second one."""
    folder = tmp_path_factory.mktemp("calibration")
    (folder / "sites.yaml").write_text(SITES)
    calibration = load_calibration(folder / "sites.yaml", machine)
    request = RunRequest(
        calibration.at(calibration.recipe.sites),
        machine,
        folder / "killed",
        datetime.now(UTC),
        simulated=SimulatedStage(machine),
        history=str(folder / "stage.db"),
    )
    killed_at_its_second_site(request)
    return folder


@pytest.fixture(scope="module")
def calibrated(killed):
    """The same gone on with; what was said, and the outcome."""
    out = killed / "outcome.json"
    said = stagectl(
        "calibrate", killed / "sites.yaml", "--simulate", "--resume", killed / "killed", "--due",
        "--history", killed / "stage.db", "--out", killed / "rest", "--json", out,
    )  # fmt: skip
    return killed, said, json.loads(out.read_text())


@pytest.fixture
def where(calibrated, tmp_path):
    """Options that name a copy of its history."""
    return "--history", shutil.copy(calibrated[0] / "stage.db", tmp_path / "stage.db")


def test_a_killed_calibration_goes_on_behind_the_last_site_and_loses_nothing(calibrated):
    folder, said, outcome = calibrated
    assert "map 1 stored in" in said
    # Every site is reported, those before the kill as well; none is measured twice but the first.
    assert [(e["site"], e["axis"]) for e in outcome["sites"]] == [
        (site, axis) for site in (1, 2, 3, 4) for axis in "xy"
    ]
    assert {e["severity"] for e in outcome["sites"]} == {"good"}
    assert all(0.0 < e["sigma"] < 0.03 for e in outcome["sites"])
    report = (folder / "rest" / "report.html").read_text()
    assert "Calibration weekly" in report
    assert "friction map used: none" in said
    assert "2 of 5 visits" in (folder / "killed" / "report.html").read_text()
    assert report.count('<span class="badge good">good</span>') == len(outcome["sites"])
    summary = json.loads((folder / "rest" / "summary.json").read_text())
    assert summary["resumed"]["done"] == 2
    assert {m["site"] for m in summary["moves"] if m["kind"] == "macro"} == {3, 4, 5}
    history = open_history(str(folder / "stage.db"))
    assert [outcome for _, _, outcome in history.runs(STAGE)] == ["completed", None]
    assert len(history.places(STAGE)) == 4
    history.close()
    assert "no site is due" in stagectl(
        "calibrate", folder / "sites.yaml", "--simulate", "--due", "--history",
        folder / "stage.db", "--out", folder / "none",
    )  # fmt: skip


def test_the_page_made_again_from_a_recording_is_that_of_the_calibration(calibrated):
    folder, _, outcome = calibrated
    for run, visits, badge in (
        ("rest", "5 of 5 visits", "Complete"),
        ("killed", "2 of 5", "Int"),
    ):
        page = folder / run / "report.html"
        page.unlink(missing_ok=True)
        said = stagectl("report", folder / run)
        assert str(page) in said
        text = page.read_text()
        assert "Calibration weekly" in text
        assert visits in text
        assert f'class="badge good">{badge}' in text or f'class="badge bad">{badge}' in text
        assert "No new map" not in text
    # the levels are the estimates', within the map's uncertainty of the map's
    page = (folder / "rest" / "report.html").read_text()
    levels = re.findall(r'data-axis="\w+">\w+</td>\s*<td class="n">([\d.]+)<', page)
    assert len(levels) == len(outcome["sites"])
    for level, entry in zip(levels, outcome["sites"], strict=True):
        assert float(level) == pytest.approx(entry["coulomb"], rel=0.05)
    assert json.loads((folder / "rest" / "summary.json").read_text())["outcome"] == "completed"


def test_friction_that_differs_on_the_way_is_not_taken_for_viscous(tmp_path):
    """+-25 % over 40 mm, sites 50 mm apart: what is the same everywhere is found as it is."""
    lines, seeds = [], iter((214, 215))
    for line in load_machine().text.splitlines():
        lines.append(line)
        if line.strip().startswith("repeatability:"):
            field = f"amplitude: 0.25, length: 0.04, seed: {next(seeds)}"
            lines.append(f"    effects: [{{effect: friction_map, {field}}}]")
    truth = tmp_path / "truth.yaml"
    truth.write_text("\n".join(lines))
    (tmp_path / "sites.yaml").write_text(
        "calibrate: far\n"
        "sites: {grid: {origin: [-0.05, -0.05], pitch: [0.05, 0.05], count: [3, 2]}}\n"
    )
    stagectl(
        "calibrate", tmp_path / "sites.yaml", "--simulate", truth, "--history",
        tmp_path / "stage.db", "--out", tmp_path / "run",
    )  # fmt: skip
    history = open_history(str(tmp_path / "stage.db"))
    ((version),) = map_versions(history, STAGE)
    history.close()
    for name, axis in load_machine().axes.items():
        true = axis.plant.friction
        for figure, is_, known in (
            ("viscous", true.viscous, 0.03),
            ("stiffness", true.stiffness, 0.06),  # the hysteresis' shape leaves 5 % open
            ("relaxation_rate", true.attraction / true.coulomb, 0.03),
        ):
            value, sigma = version.map.axes[name].figures[figure]
            assert abs(value - is_) < 3.5 * sigma, (name, figure, value, sigma)
            assert sigma < known * is_


def test_what_cannot_be_gone_on_with(calibrated):
    folder, _, _ = calibrated
    other = folder / "other.yaml"
    other.write_text(SITES.replace("weekly", "daily"))
    for sites, run, reason in (
        ("sites.yaml", "rest", "that run is complete"),
        ("other.yaml", "killed", "was made with another recipe"),
        ("sites.yaml", "nobody", "no such folder"),
    ):
        said = stagectl(
            "calibrate", folder / sites, "--simulate", "--resume", folder / run, "--history",
            folder / "stage.db", "--out", folder / "again", code=2,
        )  # fmt: skip
        assert reason in said


def test_a_map_is_looked_at_put_into_use_and_taken_back(where, tmp_path):
    page = tmp_path / "map.html"
    said = stagectl("map", "show", *where, "--html", page, "--at", "0.01", "0.01")
    assert "map 1" in said
    drawn = page.read_text()  # two heat maps and the trends of an axis
    assert (drawn.count("<svg"), drawn.count('class="chart curves"')) == (2 * 2, 2 * 4)
    assert "map 2" in stagectl("map", "build", *where, "--comment", "again")
    assert "since map 1: all sites" in stagectl("map", "compare", "1", "2", *where)
    assert "is 'nan'" in stagectl("map", "show", *where, "--at", "nan", "0", code=None)
    there = stagectl("map", "show", *where, "--at", "10mm", "-5mm")
    assert "At (10, -5) mm" in there
    stagectl("map", "activate", "1", "--check", *where)
    assert "no map is in use" in stagectl("map", "rollback", *where, code=2)
    stagectl("map", "activate", "1", *where)
    stagectl("map", "activate", "2", *where)
    assert "map 1" in stagectl("map", "rollback", *where)
    assert "rolled back" in stagectl("map", "history", *where)
    out = tmp_path / "grid.csv"
    stagectl("map", "export", out, "--what", "grid", "--step", "0.005", *where)
    with out.open() as file:
        rows = list(csv.DictReader(file))
    assert {row["inside"] for row in rows} == {"True", "False"}
    assert "no map 9" in stagectl("map", "activate", "9", *where, code=2)
    other = tmp_path / "other.yaml"
    other.write_text(load_machine().text.replace("wafer-xy", "another"))
    said = stagectl("map", "activate", "1", "--machine", other, *where, code=2)
    assert "it is of wafer-xy" in said


def test_what_maps_say_as_json(calibrated, where, tmp_path):
    outcome = calibrated[2]

    def as_json(*arguments):
        out = tmp_path / "out.json"
        stagectl("map", *arguments, *where, "--json", out)
        return json.loads(out.read_text())

    shown = as_json("show", "--at", "0.01", "0.01")
    assert (shown["format"], shown["map"], shown["active"]) == ("stagectl-map-shown", 1, False)
    at = shown["axes"]["y"]["at"]
    assert at["low"] < at["coulomb"] < at["high"]
    sites = {tuple(s["place"]): s["coulomb"] for s in shown["axes"]["x"]["sites"]}
    assert sites == {tuple(e["place"]): e["coulomb"] for e in outcome["sites"] if e["axis"] == "x"}
    assert set(outcome["expected_bits"]["x"]) == set(outcome["sites"][0]["bits"])
    checked = as_json("activate", "--check")
    assert (checked["applicable"], checked["done"]) == (True, None)
    assert as_json("activate")["done"] == "activated"
    assert [m["active"] for m in as_json("history")["maps"]] == [True]
    same = as_json("compare", "1", "1")["axes"]["x"]
    assert (same["common"], len(same["sites"])) == (0.0, 4)
    assert as_json("rollback")["map"] is None
    refused = tmp_path / "refused.json"
    other = tmp_path / "other.yaml"
    other.write_text(load_machine().text.replace("wafer-xy", "another"))
    stagectl("map", "activate", *where, "--machine", other, "--json", refused, code=2)
    assert json.loads(refused.read_text())["applicable"] is False


def test_a_run_goes_by_the_map_and_says_so(where, tmp_path):
    stagectl("map", "activate", *where)
    (tmp_path / "short.yaml").write_text(RECIPE)
    run = ("run", tmp_path / "short.yaml", "--simulate", *where)
    counts = []
    for name, options, number in (("by-map", (), 1), ("alone", ("--map", "none"), None)):
        said = stagectl(*run, "--out", tmp_path / name, *options)
        used = "none" if number is None else "map 1"
        assert f"friction map: {used}" in said
        assert f"<dt>Friction map</dt><dd>{used}" in (tmp_path / name / "report.html").read_text()
        begun = read_notes(tmp_path / name / "recording.h5").events[0]
        assert (begun["event"], begun["map"]) == ("run", number)
        summary = json.loads((tmp_path / name / "summary.json").read_text())
        assert summary.get("map") == number
        history = open_history(str(where[1]))
        seen = [m for m in history.measurements(STAGE) if m.place == (0.015, 0.01)]
        history.close()
        counts.append(len(seen))
    # A macro-move shows the level of its target only where friction on the way is known.
    assert counts[0] > counts[1] - counts[0]


def test_cogging_is_not_taken_for_friction_of_places(tmp_path):
    (tmp_path / "sites.yaml").write_text(
        "calibrate: c\nsites: [[-0.05, 0], [0, 0], [0.05, 0], [0, 0.02]]\n"
    )
    truth = tmp_path / "truth.yaml"
    cogging = "    effects: [{effect: cogging, amplitude: 1.2, pitch: 0.032, phase: 0.5}]\n"
    truth.write_text(load_machine().text.replace("  y:", cogging + "  y:", 1))
    where = ("--simulate", truth, "--history", tmp_path / "stage.db")
    outcome = tmp_path / "outcome.json"
    stagectl("calibrate", tmp_path / "sites.yaml", *where, "--json", outcome,
             "--out", tmp_path / "calibration")  # fmt: skip
    sites = [s for s in json.loads(outcome.read_text())["sites"] if s["axis"] == "x"]
    assert [s["coulomb"] for s in sites] == pytest.approx([6.0] * 4, rel=0.04)  # 1.2 N is 0.2
    stagectl("map", "activate", "--history", tmp_path / "stage.db")
    (tmp_path / "r.yaml").write_text(
        short_recipe((0.05, 0.0), (-0.05, 0.01), (0.0, 0.0), (-0.05, 0.0), (0.05, 0.01))
    )
    said = stagectl("run", tmp_path / "r.yaml", *where, "--out", tmp_path / "run")
    assert "friction map: map 1" in said
    assert "stepped" not in said


def test_due_sites_are_slipped_into_a_run_within_its_budget(where, tmp_path):
    (tmp_path / "short.yaml").write_text(RECIPE)
    run = ("run", tmp_path / "short.yaml", "--simulate", *where)
    stagectl(*run, "--out", tmp_path / "wear")
    (tmp_path / "sites.yaml").write_text(SITES + "due: {distance: 10 mm}\n")
    calibrate = ("--calibrate", tmp_path / "sites.yaml", "--budget", "2.0")
    said = stagectl(*run, *calibrate, "--out", tmp_path / "slipped")
    due, slipped = map(
        int, re.search(r"(\d+) calibration sites due, (\d+) inserted", said).groups()
    )
    assert due > slipped == 1  # the budget has room for one of them
    assert f"of 2 s; no time for the other {due - 1})" in said
    moves = json.loads((tmp_path / "slipped" / "summary.json").read_text())["moves"]
    assert sum(m["kind"] == "creep" or m["kind"] == "other" for m in moves) >= 8
    # What it has shown there is that site's, wherever its moves ended; and production's its own.
    history = open_history(str(where[1]))
    slipped_at = set(history.places(STAGE)) - {(0.01, 0.01), (0.015, 0.01)}
    assert slipped_at <= {(0.0, 0.0), (0.02, 0.0), (0.02, 0.02), (0.0, 0.02)}
    # On a virtual stage time goes on where it ended, however fast it was simulated.
    begun = [run.started for _, run, _ in history.runs(STAGE)]
    newest = history.newest(STAGE)
    history.close()
    assert begun == sorted(begun, reverse=True)
    assert newest - begun[0] > 1.0
    assert begun[0] - begun[1] > 1.0
    said = stagectl("replay", tmp_path / "slipped", code=2)
    assert "had calibration sites inserted" in said
