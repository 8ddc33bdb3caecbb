"""The table of `stagectl runs`: what no run names has no column."""

import json

import pytest
from click.testing import CliRunner

from stagectl.cli.runs import command
from tests.unit.stagectl.run.whole import write_summary


def _header(folder):
    printed = CliRunner().invoke(command, [str(folder)]).output
    return next(line for line in printed.splitlines() if "started" in line).split()


def test_columns_that_no_run_fills_are_left_out(tmp_path):
    write_summary(tmp_path / "a")
    assert _header(tmp_path) == "started recipe stage outcome settling run".split()
    write_summary(tmp_path / "b", wafer="W7")
    assert _header(tmp_path) == "started recipe stage wafer outcome settling run".split()


def test_names_and_folders_are_whole_on_any_terminal(tmp_path, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    name = "inspection-20-20260304-050607"
    write_summary(
        tmp_path / name, operator="A. Meier", comment="after re-greasing of the y guideway"
    )
    lines = CliRunner().invoke(command, [str(tmp_path)]).output.splitlines()
    (line,) = [line for line in lines if "2026-11-22 08:00" in line]
    said = ("inspection", "virtual", "A. Meier", "after re-greasing of the y guideway",
            "completed", str(tmp_path / name))  # fmt: skip
    assert all(words in line for words in said)


def test_only_runs_of_a_lot_since_a_date_or_that_failed(tmp_path):
    write_summary(tmp_path / "a", lot="L1")
    write_summary(tmp_path / "b", lot="L2", started="2026-11-24T00:00:00+00:00", outcome="fault")
    write_summary(tmp_path / "c", started="2026-11-25T00:00:00+00:00", limits={"verdict": "fail"})

    def listed(*options):
        done = CliRunner().invoke(command, [str(tmp_path), *options, "--json", "-"])
        return [run["folder"].rsplit("/")[-1] for run in json.loads(done.output)["runs"]]

    assert listed("--lot", "L1") == ["a"]
    assert listed("--since", "2026-11-23") == ["b", "c"]
    assert listed("--failed") == ["b", "c"]
    assert listed("--failed", "--lot", "L2") == ["b"]


def test_a_resumed_run_names_the_one_it_continues_and_settling_is_listed(tmp_path):
    micro = {"settling_median": {"5e-08": 0.0025, "2e-07": 0.0}}
    write_summary(tmp_path / "b", resumed={"run": "runs/a", "done": 3}, micro=micro)
    lines = CliRunner().invoke(command, [str(tmp_path)]).output.splitlines()
    assert "continues" in _header(tmp_path)
    (line,) = [line.split() for line in lines if "2026-11-22" in line]
    assert line[-1] == "runs/a"
    assert "2.5" in line


@pytest.mark.parametrize("operator", [{"first": "A."}, ["A."], 7, "A.\x1b[31m"])
def test_one_run_that_is_not_as_it_should_be_hides_no_other(tmp_path, operator):
    write_summary(tmp_path / "good")
    write_summary(tmp_path / "odd", operator=operator)
    done = CliRunner().invoke(command, [str(tmp_path)])
    assert done.exit_code == 0, done.exception
    assert "completed" in done.output
    assert "unreadable" in done.output
    assert "\x1b[31m" not in done.output


def test_two_runs_stand_beside_each_other(tmp_path):
    def move(settling):
        times = {"5e-08": settling, "2e-07": 0.0}
        return {"site": 1, "axis": "x", "kind": "micro", "peak_error": 9e-8, "distance": 5e-5,
                "settling": times, "settled": True}  # fmt: skip

    figures = {"coulomb": {"value": 6.02, "sigma": 0.05, "unit": "N"}}
    entry = {"site": 1, "axis": "x", "accepted": True, "reason": None, "parameters": figures}
    for name, settling in (("a", 0.002), ("b", 0.012)):
        write_summary(
            tmp_path / name, format="stagectl-run-summary", moves=[move(settling)],
            friction=[entry], compensation="estimated", seed=1, duration=1.0, wall_time=0.1,
            cycle={"period": 1e-3, "missed": 0, "late": 0}, wafer=f"W-{name}",
        )  # fmt: skip
    done = CliRunner().invoke(command, ["compare", str(tmp_path / "a"), str(tmp_path / "b")])
    assert done.exit_code == 0, done.exception
    rows = [" ".join(line.split()) for line in done.output.splitlines()]
    assert "x micro: ±50 nm, ms 2 12" in rows
    assert "x coulomb, N 6.020 ± 0.050 6.020 ± 0.050" in rows
    assert "Wafer W-a W-b" in rows
    none = CliRunner().invoke(command, ["compare", str(tmp_path), str(tmp_path / "b")])
    assert "no summary of a run" in str(none.exception)
