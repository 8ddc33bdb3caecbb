"""Drives with pp and homing alone (0x6502 = 0x21): moved by their own profile, never streamed."""

import json

import numpy as np
import pytest
from click.testing import CliRunner

from drivers.errors import AxisFault, ConfigurationError, LimitError
from hil_sim.cia301 import key
from stagectl.cli import cli
from stagectl.errors import RunFault
from stagectl.store import read_recording
from tests.lockstep import open_on, power_up, switch_on
from tests.short_recipe import short_recipe

SHAKEN = """\
recipe: shaken
macro: {velocity: 0.1, acceleration: 1.0, jerk: 50.0}
micro: {velocity: 0.01, acceleration: 0.2, jerk: 20.0}
settle: {window: 5.0e-8, hold: 0.005, timeout: 0.15}
moves:
  - {excite: x, shape: chirp, amplitude: 1.0e-5, band: [10, 50], duration: 0.5}
"""
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


def run(recipe, world, machine, folder):
    file, text = folder / "m.yaml", folder / "r.yaml"
    file.write_text(machine.text, encoding="utf-8")
    text.write_text(recipe, encoding="utf-8")
    arguments = ["--out", str(folder / "out"), "--machine", str(file)]
    return CliRunner().invoke(
        cli, ["run", str(text), *arguments, "--bus", f"lockstep:{world.name}"]
    )


def test_a_recipe_runs_by_their_own_profiles_and_is_learned_from(pp_only, stage_machine, tmp_path):
    _, world = pp_only
    done = run(short_recipe((0.01, 0.0), (0.02, 0.01)), world, stage_machine, tmp_path)
    assert done.exception is None, (done.output, done.exception)
    assert "axes x, y: scale and sign were never checked by a move with these units" in done.output
    assert "moves go by the drives' own profiles (pp): nothing is compensated" in done.output
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["outcome"] == "completed"
    assert all(move["settled"] for move in summary["moves"])
    learned = [e for e in summary["friction"] if e["axis"] == "x" and e["accepted"]]
    assert learned[-1]["parameters"]["coulomb"]["value"] == pytest.approx(6.0, rel=0.05)
    recording = read_recording(tmp_path / "out" / "recording.h5")
    for axis in recording.axes.values():
        assert not axis.force_offset.any()
        assert axis.missing == ("position_demand",)  # a diagnosis goes along the motion
        assert axis.valid.all()


def test_a_recipe_that_has_to_stream_is_refused_before_power(pp_only, stage_machine, tmp_path):
    drives, world = pp_only
    words = []
    for drive in drives.drives:
        drive.dictionary.on_write[key(0x6040)] = words.append
    done = run(SHAKEN, world, stage_machine, tmp_path)
    assert isinstance(done.exception, RunFault)
    assert str(done.exception).startswith("axis x: 0x6502:00 supported drive modes: 0x00000021: ")
    assert 0x0F not in words


def test_a_stop_halts_them_on_the_way(pp_only, stage_machine):
    with open_on(pp_only[1], stage_machine) as stage:
        power_up(stage)
        start, seen = stage.positions[0], []

        def until(positions):
            seen.append(positions[0])
            return len(seen) == 200

        goal = (start + 0.05, stage.targets[1])
        samples = stage.stream_to(goal, (0.1, 0.1), (1.0, 1.0), until)
        assert len(samples) == 200
        np.testing.assert_array_equal(samples.position_demand[:, 0], goal[0])
        at = stage.positions[0]
        assert 0.01 < at - start < 0.03
        assert np.ptp(stage.hold(0.05).position[:, 0]) < 1e-6


def test_a_target_that_is_not_taken_or_not_reached_stops_all_axes(pp_only, stage_machine):
    drives, world = pp_only
    objects, bits = drives.drives[0].dictionary, [0]
    objects.live[key(0x6041)] = lambda: objects.integer(key(0x6041)) | bits[0]
    with open_on(world, stage_machine) as stage:
        power_up(stage)
        with pytest.raises(LimitError, match=r"^axis x: .*above the limit 0\.15 m"):
            stage.stream_to((0.2, 0.0), (0.1, 0.1), (1.0, 1.0))
        assert stage.enabled
        bits[0] = 1 << 12  # stuck
        with pytest.raises(AxisFault, match=r"^axis x: 0x607A:00 .*is not ready for setpoint"):
            stage.stream_to((0.01, 0.0), (0.1, 0.1), (1.0, 1.0))
