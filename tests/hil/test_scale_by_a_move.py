"""`stagectl check NODE --move`: drives whose numbers mean something else are found by 0.1 mm."""

import json
from datetime import UTC, datetime

import pytest
from click.testing import CliRunner

from hil_sim.quirks import OddOffset, Quirks
from stagectl.cli import cli
from stagectl.config import load_machine
from stagectl.measurement import never_checked, note_checked
from stagectl.store import read_notes
from tests.lockstep import switch_on
from tests.short_recipe import short_recipe

START = (-5e-3, -4e-3)


def checked(machine, folder, alter=lambda drive: None, *options):
    """What the command says of the machine's drive 1, and its file."""
    drives, world = switch_on(machine, start=START)
    alter(drives.drives[0])
    file, out = folder / "m.yaml", folder / "out.json"
    file.write_text(machine.text, encoding="utf-8")
    where = ["--machine", str(file), "--bus", f"lockstep:{world.name}", "--json", str(out)]
    done = CliRunner().invoke(cli, ["check", "1", "--move", *where, *(options or ["--yes"])])
    rows = json.loads(out.read_text(encoding="utf-8")) if out.exists() else []
    return done, {row["what"].split(",")[0]: row for row in rows}, file


def test_a_drive_that_means_what_it_says_is_noted_and_runs_no_longer_tell_of_it(
    stage_machine, tmp_path
):
    done, rows, file = checked(stage_machine, tmp_path)
    assert done.exception is None, done.output
    assert [row["agrees"] for row in rows.values()] == [True] * 5, rows
    assert rows["profile velocity"]["found"] == pytest.approx(2e-4, rel=0.1)
    assert rows["force offset"]["found"] == pytest.approx(rows["force offset"]["asked"], rel=0.4)
    machine = load_machine(file)
    assert never_checked(machine).startswith("axes y: scale and sign were never checked")
    assert note_checked(machine, "y", datetime.now(UTC)) == tmp_path / "m.checked.json"
    assert never_checked(machine) is None
    file.write_text(
        stage_machine.text.replace("rated_force: 40.0", "rated_force: 41.0"), encoding="utf-8"
    )
    assert never_checked(load_machine(file)).startswith("axes x: ")


@pytest.mark.parametrize("noted", ["", "x", "xy"])
def test_a_whole_run_names_the_axes_that_were_never_checked(noted, stage_machine, tmp_path):
    _, world = switch_on(stage_machine, start=START)
    file, recipe = tmp_path / "m.yaml", tmp_path / "r.yaml"
    file.write_text(stage_machine.text, encoding="utf-8")
    recipe.write_text(short_recipe((1e-3, 0.0)), encoding="utf-8")
    for axis in noted:
        note_checked(load_machine(file), axis, datetime.now(UTC))
    where = ["--machine", str(file), "--bus", f"lockstep:{world.name}", "--out"]
    options = ["--compensation", "none", "--no-observer"]
    done = CliRunner().invoke(cli, ["run", str(recipe), *where, str(tmp_path / "o"), *options])
    assert done.exception is None, (done.output, done.exception)
    line = "scale and sign were never checked by a move with these units"
    left = ", ".join(axis for axis in "xy" if axis not in noted)
    said = [shown for shown in done.output.splitlines() if line in shown]
    assert {shown.partition(":")[0] for shown in said} == ({f"axes {left}"} if left else set())
    notes = [e["text"] for e in read_notes(tmp_path / "o" / "recording.h5").all("limitation")]
    assert sum(line in note for note in notes) == (1 if left else 0)


def turned(drive):
    drive.motor._odd = OddOffset(Quirks(offset_sign=-1))  # noqa: SLF001  as by its settings


def ten_times_as_fast(drive):
    drive.motor.speed_unit *= 10


@pytest.mark.parametrize(
    ("alter", "what"),
    [(turned, ["force offset", "its direction"]), (ten_times_as_fast, ["profile velocity"])],
)
def test_wrong_scale_or_sign_is_named_and_not_noted(alter, what, stage_machine, tmp_path):
    done, rows, _ = checked(stage_machine, tmp_path, alter)
    assert [name for name, row in rows.items() if not row["agrees"]] == what, rows
    assert str(done.exception).startswith(f"axis x: {what[0]}")
    assert str(done.exception).count("\n") == 0
    assert not (tmp_path / "m.checked.json").exists()


def test_without_a_yes_nothing_moves(stage_machine, tmp_path):
    done, rows, _ = checked(stage_machine, tmp_path, lambda _: None, "--no-power")
    assert "Go ahead?" in done.stderr
    assert done.exit_code == 1
    assert not rows
