"""The table of `stagectl runs`: what no run names has no column."""

from __future__ import annotations

import json

import pytest
from click.testing import CliRunner

from stagectl.cli.runs import command


def _write_run(folder, **more):
    folder.mkdir(parents=True)
    summary = {
        "format": "stagectl-summary",
        "version": 1,
        "recipe": "inspection-20",
        "machine": "wafer-xy",
        "started": "2026-03-04T05:06:07+00:00",
        "simulated": True,
        "lot": None,
        "fault": None,
        "outcome": "completed",
        **more,
    }
    (folder / "summary.json").write_text(json.dumps(summary))


def _header(folder):
    printed = CliRunner().invoke(command, [str(folder)]).output
    return next(line for line in printed.splitlines() if "started" in line).split()


def test_columns_that_no_run_fills_are_left_out(tmp_path):
    _write_run(tmp_path / "a")
    assert _header(tmp_path) == ["started", "recipe", "outcome", "run"]
    _write_run(tmp_path / "b", wafer="W7")
    assert _header(tmp_path) == ["started", "recipe", "wafer", "outcome", "run"]


def test_the_name_of_a_folder_is_not_broken_at_80_columns(tmp_path, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    name = "inspection-20-20260304-050607"
    _write_run(tmp_path / name, operator="A. Meier", comment="after re-greasing of the y guideway")
    lines = CliRunner().invoke(command, [str(tmp_path)]).output.splitlines()
    assert any(name in line for line in lines)
    assert any("2026-03-04 05:06" in line for line in lines)
    assert any("completed" in line for line in lines)
    assert any("operator" in line for line in lines)
    assert max(map(len, lines)) <= 80


@pytest.mark.parametrize("operator", [{"first": "A."}, ["A."], 7, "A.\x1b[31m"])
def test_one_run_that_is_not_as_it_should_be_hides_no_other(tmp_path, operator):
    _write_run(tmp_path / "good")
    _write_run(tmp_path / "odd", operator=operator)
    done = CliRunner().invoke(command, [str(tmp_path)])
    assert done.exit_code == 0, done.exception
    assert "completed" in done.output
    assert "unreadable" in done.output
    assert "\x1b[31m" not in done.output
