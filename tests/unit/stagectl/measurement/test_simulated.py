"""The measurement of virtual stages, through CAN frames."""

import os

import numpy as np
import pytest

from drivers.stage import Stage
from hil_sim.bus import LockstepBus, World
from hil_sim.stage import VirtualStage
from stagectl.config import driver_settings, stage_settings
from stagectl.config.machine import Effect, Quirks
from stagectl.errors import Aborted, RunFault, UnusableInput
from stagectl.measurement import (
    find_contradictions,
    measure_simulated,
    measure_virtual_stage,
    parse_measurement,
)
from stagectl.measurement import simulated as module
from stagectl.measurement.procedure import measure_stage
from tests.unit.stagectl.machines import with_axes


def quirk(**of):
    return {"drive": {"quirks": Quirks(**of)}}


def effect(name, **figures):
    return {"effects": (Effect(name, figures),)}


def said(machine, measured, name="x"):
    axis = machine.axes[name]
    response = measured.axes[name].response
    return find_contradictions(axis, axis.plant.friction.figures, 1e-3, response)


@pytest.fixture(scope="module")
def as_modelled(machine):
    return measure_simulated(machine, machine, 1)


def test_a_stage_as_modelled_contradicts_nothing(machine, as_modelled):
    for name, axis in machine.axes.items():
        found = said(machine, as_modelled, name)
        assert found.contradictions == ()
        assert found.step is None
        assert found.fitted.figures.mass == pytest.approx(axis.plant.mass, rel=0.02)


LATE = ["force offsets act 3.00 ms (3 SYNC periods) late", "positions (0x6064) are 1.0"]
HUNG = {"frequency": 250.0, "damping": 0.01, "mass_ratio": 0.2}


@pytest.mark.parametrize(
    ("x", "y", "clauses"),
    [
        (
            quirk(offset_delay=3, position_delay=1), quirk(offset_sign=-1),
            (LATE, ["force offsets (0x60B2) act with the wrong sign"]),
        ),
        (
            effect("resonance", **HUNG), effect("force_constant", ratio=0.5),
            (
                ["a resonance at 250 Hz that the file does not have"],
                ["the force per acceleration is 2 times the file's"],
            ),
        ),
        pytest.param(
            quirk(offset_step=0.01), {},
            (["force offsets act in steps of about 0.4"], []), marks=pytest.mark.slow,
        ),
    ],
    ids=["late and sign", "resonance and force constant", "steps"],
)  # fmt: skip
def test_what_differs_is_said_in_terms_of_the_file(machine, x, y, clauses):
    measured = measure_simulated(machine, with_axes(machine, x=x, y=y), 1)
    for name, clause in zip("xy", clauses, strict=True):
        found = said(machine, measured, name).contradictions
        for has, begins in zip(found, clause, strict=True):
            assert has.startswith(begins)


def test_it_is_kept_by_all_that_it_depends_on(machine, as_modelled, monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    made = []
    monkeypatch.setattr(module, "measure_simulated", lambda *all_: made.append(all_) or as_modelled)
    cold = measure_virtual_stage(machine, machine)
    warm = measure_virtual_stage(machine, machine)
    assert len(made) == 1
    assert cold.as_text() == warm.as_text() == as_modelled.as_text()
    assert parse_measurement(cold.as_text(), "again").as_text() == cold.as_text()
    heavier = with_axes(machine, x=effect("payload_mass", mass=2.0))
    measure_virtual_stage(machine, heavier)
    assert [truth for _, truth, *_ in made] == [machine, heavier]


def test_only_the_latest_are_kept(monkeypatch, tmp_path):
    monkeypatch.setattr(module, "KEPT", 2)
    for number in range(4):
        module.keep(tmp_path / f"{number}.json", "text")
        os.utime(tmp_path / f"{number}.json", ns=(number, number))
    module.keep(tmp_path / "4.json", "text")
    assert sorted(file.name for file in tmp_path.iterdir()) == ["3.json", "4.json"]


@pytest.fixture
def enabled(machine):
    """An enabled stage whose drives can be odd; as many as are asked for."""
    opened = []

    def enable(truth, host=machine):
        world = World(f"measured-{len(opened)}-{id(truth)}")
        drives = VirtualStage(stage_settings(truth), 1)
        drives.attach(world)
        bus = LockstepBus(channel=world.name)
        settings, axes = driver_settings(host)
        stage = Stage.open(settings, axes, bus_object=bus)
        opened.append((stage, bus, world, drives))
        stage.boot()
        stage.home()
        stage.enable()
        return stage

    yield enable
    for stage, bus, _, _ in opened:
        stage.close()
        bus.shutdown()


def test_it_stays_within_what_it_states(machine, enabled):
    stage, stated, samples = enabled(machine), [], []
    stage.sink = samples.append
    measure_stage(stage, machine, agreed=lambda lines: stated.extend(lines) or True)
    assert len(stated) == 3
    assert stated[0].startswith("x: from -0.003 to 31.7")
    table = np.array(samples, dtype=np.int64)
    x = table[:, 4:12]
    target, offset, position, force = x[:, 0] * 1e-9, x[:, 1] * 0.04, x[:, 2] * 1e-9, x[:, 3] * 0.04
    assert np.abs(offset).max() <= 1.8 + 0.02
    assert np.abs(force).max() <= 60.0
    assert np.abs(np.diff(position)).max() / 1e-3 <= 15e-3
    assert target.min() >= -3e-6
    assert target.max() <= 31.8e-3
    assert stage.targets == pytest.approx((0.0, 0.0), abs=3e-6)


def test_a_limit_ends_it(machine, enabled):
    """A stage with ten times the friction needs more force than is allowed."""
    plant = machine.axes["x"].plant
    figures = plant.friction.model_copy(update={"coulomb": 80.0})
    truth = with_axes(machine, x={"plant": plant.model_copy(update={"friction": figures})})
    with pytest.raises(RunFault, match=r"axis x: (motor force|following error) above"):
        measure_stage(enabled(truth), machine)


def test_nothing_moves_before_it_is_agreed_to(machine, enabled):
    stage = enabled(machine)
    samples = []
    stage.sink = samples.append
    with pytest.raises(Aborted, match="not measured"):
        measure_stage(stage, machine, agreed=lambda _: False)
    assert samples == []


def test_it_is_stopped_at_any_sync(machine, enabled):
    asked = []
    with pytest.raises(Aborted, match="stopped by the operator"):
        measure_stage(enabled(machine), machine, stop=lambda: asked.append(0) or len(asked) > 700)
    assert len(asked) == 701


def test_no_room_to_slide(machine, enabled):
    narrow = with_axes(machine, x={"travel": (-0.01, 0.01)})
    with pytest.raises(UnusableInput, match=r"axes\.x\.travel: the measurement slides by 31\.7 mm"):
        measure_stage(enabled(machine), narrow)


@pytest.mark.slow
def test_a_slow_integrator_is_no_step_of_the_offset(machine):
    """What it leaves drifts through all periods alike."""
    pid = machine.axes["x"].drive.pid
    weak = {"drive": {"pid": pid.model_copy(update={"ki": 0.01 * pid.ki})}}
    slow = with_axes(machine, x=weak, y=weak)
    found = said(machine, measure_simulated(machine, slow, 1))
    assert found.step is None
    assert found.fitted.figures.mass == pytest.approx(8.0, rel=0.03)


def test_a_missed_sample_is_no_speed(machine, enabled):
    """The position stands for a few SYNCs, then has moved as far as in all of them."""
    stage = enabled(machine)
    stream = stage.stream

    def seldom(position, offset, until=None):
        seen = []

        def see(now):
            seen.append(now if len(seen) % 50 >= 3 or not seen else seen[-1])
            return until(seen[-1])

        return stream(position, offset, see)

    stage.stream = seldom
    assert measure_stage(stage, machine).axes.keys() == {"x", "y"}
