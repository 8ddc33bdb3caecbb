"""Recordings into the off-line identification, and what its command says of them."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from estimation.offline import Samples
from estimation.offline.held_out import BETTER, NO_BETTER, UNTESTED, WORSE
from estimation.trajectory import Limits, plan
from hil_sim.plant import simulate
from hil_sim.settings import SUBSTEPS
from stagectl.calibration import identify_axis, identify_pieces
from stagectl.cli.identify import command
from stagectl.config import parse_machine, stage_settings
from stagectl.config.machine.file import load_machine
from stagectl.errors import UnusableInput
from stagectl.recipe import load_recipe
from stagectl.run import Listener, execute
from stagectl.store import RecordingBlocks, read_recording, write_recording
from tests.unit.stagectl.run.whole import request_for

DATA = Path(__file__).parents[3] / "data"
RECIPE = Path(__file__).parents[4] / "recipes" / "inspection-20.yaml"

FIGURES = {
    "coulomb": 0.02, "viscous": 0.02, "stiffness": 0.02, "relaxation_rate": 0.06,
    "static_ratio": 0.06, "stribeck_velocity": 0.06, "stribeck_shape": 0.08,
}  # fmt: skip
"""How far an estimate may be off: the stage's own figures differ from the file's by 0.3 %, and the
Coulomb force wanders by 1 %."""


@pytest.fixture(scope="module")
def recording():
    """The reference stage, recorded by an independent program; its first seconds."""
    return replace(next(iter(RecordingBlocks(DATA / "null-3.h5", 6000))), moves=())


@pytest.fixture(scope="module")
def answer(recording, tmp_path_factory):
    """What the command prints and writes for axis x."""
    folder = tmp_path_factory.mktemp("identify")
    write_recording(recording, folder / "part.h5")
    out = folder / "friction.json"
    arguments = [str(folder / "part.h5"), "--axis", "x", "--json", str(out)]
    result = CliRunner().invoke(command, arguments, catch_exceptions=False)
    assert result.exit_code == 0
    return result.output, json.loads(out.read_text())


@pytest.mark.slow
def test_known_forces_are_subtracted_first(recording, answer):
    """Cogging that was added to a real recording: nothing can be estimated until it is known."""
    x = recording.axes["x"]
    wave = 1.2 * np.sin(2 * np.pi * x.position_actual / 0.032 + 0.5)
    cogged = replace(x, force_actual=x.force_actual + wave)
    disturbed = replace(recording, axes={**recording.axes, "x": cogged})
    effect = "    effects: [{effect: cogging, amplitude: 1.2, pitch: 0.032, phase: 0.5}]\n"
    plain = load_machine()
    twin = parse_machine(plain.text.replace("  y:", effect + "  y:", 1), "twin.yaml")
    refused = identify_axis([disturbed], plain, "x")
    assert "residual" in str(refused.reason)
    known = identify_axis([disturbed], twin, "x")
    alone = answer[1]["axes"]["x"]["figures"]
    assert known.reason is None
    for name in ("coulomb", "viscous", "stiffness"):
        assert known[name].value == pytest.approx(alone[name]["value"], rel=0.005), name


def test_the_reference_stage_is_the_machine_file(answer):
    axis = answer[1]["axes"]["x"]
    figures = axis["figures"]
    assert axis["refused"] is None
    for name, limit in FIGURES.items():
        assert figures[name]["verdict"] == "estimated"
        assert figures[name]["value"] == pytest.approx(figures[name]["prior"], rel=limit), name
    assert abs(figures["asymmetry"]["value"]) < 4 * figures["asymmetry"]["sigma"] < 0.08
    for i in range(1, 11):
        for name in (f"k_{i}", f"nu_{i}"):
            assert figures[name]["value"] == pytest.approx(figures[name]["prior"], rel=0.3), name
    assert axis["misfit"]["after"] < 1.1
    assert axis["misfit"]["held_out"] < 1.2


@pytest.mark.slow
def test_a_stage_that_follows_well_does_not_tell_its_mass_from_the_ripple(tmp_path):
    """There the encoder's noise is all that does: the mass was 7 % off by many of its sigmas."""
    machine = load_machine(None)
    request = request_for(machine, tmp_path, recipe=load_recipe(RECIPE, machine))
    assert execute(request, Listener()).error is None
    mass = identify_axis([read_recording(tmp_path / "recording.h5")], machine, "x")["mass"]
    assert mass.value == pytest.approx(8.0, abs=2.0 * mass.sigma)
    assert mass.sigma > 0.1


def test_the_command_prints_what_it_writes(answer):
    printed, report = answer
    assert (report["format"], report["version"]) == ("stagectl-friction", 1)
    assert list(report["axes"]) == ["x"]
    keys = {"unit", "prior", "prior_sigma", "value", "sigma", "gain", "verdict", "held_out"}
    assert all(set(f) == keys for f in report["axes"]["x"]["figures"].values())
    for text in ("static_ratio", "force_offset [N]", "estimated", "held-out moves", "nu_i"):
        assert text in printed
    assert max(len(line) for line in printed.splitlines()) <= 80


def test_it_says_of_every_figure_what_held_out_moves_say(answer):
    """Each alone they may predict better what all together do not: none is recommended then."""
    printed, report = answer
    axis = report["axes"]["x"]
    told = {name: axis["figures"][name]["held_out"] for name in FIGURES}
    assert set(told.values()) <= {BETTER, NO_BETTER, WORSE}
    assert axis["figures"]["mass"]["held_out"] == UNTESTED
    better = {name for name, said in told.items() if said == BETTER}
    assert better
    apart = "all together do not" in " ".join(printed.split())
    assert set(axis["recommended"]) == (set() if apart else better)


def test_other_periods_and_axes_are_refused(recording):
    slow = replace(recording, time=recording.time * 2.0)
    with pytest.raises(UnusableInput, match=r"null-3\.h5: axis x: SYNC period is 0\.002 s"):
        identify_axis([slow], load_machine(), "x")
    lone = replace(recording, axes={"y": recording.axes["y"]})
    with pytest.raises(UnusableInput, match="no such axis"):
        identify_axis([lone], load_machine(), "x")


def test_command_names_what_it_cannot_use():
    arguments = [str(DATA / "null-2.h5"), "--axis", "z"]
    with pytest.raises(UnusableInput, match="no axis 'z', it has x, y"):
        CliRunner().invoke(command, arguments, catch_exceptions=False)


@pytest.mark.slow
def test_mass_and_lag_are_found_within_their_sigma():
    """A stage 7 % heavier and with other friction than believed, its moves without friction's help.

    The simulated force is late: by a plant step, and by what the stairs of the command leave.
    """
    machine = load_machine(None)
    stage = stage_settings(machine)
    axis = stage.axes[0]
    friction = replace(axis.friction, coulomb=7.5, stiffness=4.5e5)
    truth = replace(axis, mass=1.07 * axis.mass, friction=friction)
    generator = np.random.default_rng(5)
    demand, offset, at = [np.zeros(100)], [np.zeros(100)], 0.0
    for number in range(18):
        limits = Limits(0.5, 3.0, 200.0) if number % 3 == 0 else Limits(0.01, 0.2, 20.0)
        target = generator.uniform(-0.04, 0.04) if number % 3 == 0 else at + 6e-5 * (-1) ** number
        motion = plan(at, target, limits)
        position, _, acceleration = motion.sample(np.arange(1, 1e3 * motion.duration + 120) * 1e-3)
        demand.append(position)
        offset.append(axis.mass * acceleration)
        at = target
    sent, force = np.concatenate(demand), np.concatenate(offset)
    response = simulate(replace(stage, axes=(truth,)), sent[:, None], force[:, None], 5)
    valid = np.ones(len(sent), dtype=np.bool_)
    samples = Samples(response.position[:, 0], response.force[:, 0], valid, 0.0, sent)
    believed = machine.axes["x"]
    answer = identify_pieces([(samples, force)], believed, believed.plant.friction.figures, 1e-3)
    tick, loop = 1e-4, 0.5 / (np.pi * 1500.0)
    late = tick / (1.0 - np.exp(-tick / loop)) - tick / 2.0 - loop + tick / SUBSTEPS
    mass, lag = answer["mass"], answer["lag"]
    assert mass.verdict == lag.verdict == "estimated"
    assert mass.sigma < 0.01 * truth.mass
    assert abs(mass.value - truth.mass) < 2.0 * mass.sigma
    assert abs(lag.value - late) < 2.0 * lag.sigma
