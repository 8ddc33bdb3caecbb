"""Drives with pp and homing alone (0x6502 = 0x21): moved by their own profile, never streamed."""

import numpy as np
import pytest
from click.testing import CliRunner

from drivers.errors import ConfigurationError
from hil_sim.cia301 import key
from stagectl.cli import cli
from stagectl.errors import RunFault
from tests.lockstep import open_on, power_up, switch_on
from tests.short_recipe import short_recipe

ONLY_PP = "axis x: no csp: only moves by the drive's own profile (pp), nothing can be streamed"


@pytest.fixture
def pp_only(stage_machine):
    """The drives and their bus; that of axis x has no csp."""
    drives, world = switch_on(stage_machine, start=(-5e-4, -4e-4))
    drives.drives[0].dictionary.values[key(0x6502)] = 0x21
    return drives, world


def test_they_are_homed_enabled_held_and_moved(pp_only, stage_machine):
    drives, world = pp_only
    with open_on(world, stage_machine) as stage:
        power_up(stage)
        assert stage.limitations == (ONLY_PP,)
        start = stage.positions[0]
        for distance in (2e-4, -1e-4):
            stage.move_to("x", start + distance, velocity=0.01, acceleration=1.0)
            held = stage.hold(0.1)
            np.testing.assert_allclose(held.position[:, 0], start + distance, atol=3e-6)
        with stage.profile_moves(velocity=0.01, acceleration=1.0) as moves:
            moves.to("x", start)
        stage.hold(0.05)
        assert {d.dictionary.integer(key(0x6061)) for d in drives.drives} == {1}
        row = np.array([stage.targets]) + 1e-6
        with pytest.raises(ConfigurationError, match=r"^axis x: 0x6502:00 .*0x00000021"):
            stage.stream(row, np.zeros_like(row))
        assert stage.enabled
        stage.halt()
        stage.disable()


@pytest.mark.parametrize(
    "command",
    [["enable", "--hold", "0.1"], ["home"], ["jog", "x", "0.1mm", "--velocity", "1mm/s"]],
)
def test_commands_by_hand_work(command, pp_only, stage_machine, tmp_path):
    file = tmp_path / "m.yaml"
    file.write_text(stage_machine.text, encoding="utf-8")
    where = ["--machine", str(file), "--bus", f"lockstep:{pp_only[1].name}"]
    done = CliRunner().invoke(cli, [*command, *where])
    assert done.exception is None, (done.output, done.exception)
    assert ONLY_PP in done.stderr or command == ["home"]


def test_a_run_is_refused_before_power(pp_only, stage_machine, tmp_path):
    drives, world = pp_only
    file, recipe = tmp_path / "m.yaml", tmp_path / "r.yaml"
    file.write_text(stage_machine.text, encoding="utf-8")
    recipe.write_text(short_recipe((0.01, 0.0)), encoding="utf-8")
    arguments = [
        "run", str(recipe), "--out", str(tmp_path / "out"), "--compensation", "none",
        "--machine", str(file), "--bus", f"lockstep:{world.name}",
    ]  # fmt: skip
    words = []
    for drive in drives.drives:
        drive.dictionary.on_write[key(0x6040)] = words.append
    done = CliRunner().invoke(cli, arguments)
    assert isinstance(done.exception, RunFault)
    assert str(done.exception).startswith("axis x: 0x6502:00 supported drive modes: 0x00000021: ")
    assert 0x0F not in words
