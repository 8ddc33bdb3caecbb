"""Parameter types that commands share."""

from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from stagectl.cli import cli
from stagectl.cli.files import Output
from stagectl.cli.options import JSON_FILE, RECORDING, NumberRange


@pytest.mark.parametrize(
    "command",
    [
        "enable --simulate --hold nan",
        "bus-budget --sync-period nan",
        "run r.yaml --simulate --friction-scale nan",
        "run r.yaml --simulate --budget nan",
        "map activate --max-age nan",
        "map export out.csv --step nan",
        "scan --simulate --listen nan",
    ],
)
def test_nan_is_in_no_range(command):
    result = CliRunner().invoke(cli, command.split())
    assert result.exit_code == 2
    assert "nan is not a number" in " ".join(result.stderr.split())


def test_a_number_within_its_range_is_accepted():
    assert NumberRange(0.0, 2.0).convert("1.5", None, None) == 1.5
    with pytest.raises(click.BadParameter):
        NumberRange(0.0, 2.0).convert("2.5", None, None)


@pytest.mark.parametrize(
    "command",
    ["gap measure RUN", "gap diagnose RUN", "gap diagnose r.h5 --check RUN", "gap compare RUN r.h5",
     "gap compare m.yaml RUN r.h5", "gap compare m.yaml n.yaml RUN", "identify RUN", "report RUN"],
)  # fmt: skip
def test_the_folder_of_a_run_is_taken_for_its_recording(command, tmp_path):
    """Looked into in one place, which is what this folder without one shows."""
    arguments = [word.replace("RUN", str(tmp_path)) for word in command.split()]
    failed = CliRunner().invoke(cli, arguments).exception
    assert str(failed) == f"{tmp_path}: holds no recording.h5"
    (tmp_path / "recording.h5").touch()
    assert RECORDING.convert(tmp_path, None, None) == tmp_path / "recording.h5"


def test_output_files_are_checked_before_the_work(tmp_path):
    assert JSON_FILE.convert("-", None, None) == Path("-")
    for value, why in (
        ("-", "cannot be written to standard output"),
        (tmp_path, "is a directory"),
        (tmp_path / "none" / "a.html", "there is no folder"),
    ):
        with pytest.raises(click.BadParameter, match=why):
            Output().convert(value, None, None)


def test_a_misspelt_packaged_recipe_is_answered_with_those_there_are():
    result = CliRunner().invoke(cli, ["run", "inspektion-20", "--simulate"])
    assert result.exit_code == 2
    said = " ".join(result.stderr.split())
    assert "inspektion-20: no such file; packaged: calibration-9, inspection-20" in said
