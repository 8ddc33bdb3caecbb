"""What a run makes, and what it leaves alone where it cannot begin."""

import can
import pytest

from drivers.canopen import open_bus
from hil_sim.bus import faults as f
from stagectl.config import driver_settings, stage_settings
from stagectl.history import StageKey, open_history
from stagectl.run import HostSettings, Listener, Resumed, SimulatedStage, execute
from stagectl.run.execution import file_earlier_runs, prepare, virtual_stage
from stagectl.sequencer import Mode
from stagectl.store import Journal, JournalHeader, read_recording
from tests.unit.stagectl.run.whole import request_for
from tests.unit.stagectl.store.journals import HEADER, sample


@pytest.fixture
def request_of(machine, tmp_path):
    def make(folder=tmp_path / "run", **changes):
        return request_for(machine, folder, **{"host": HostSettings(Mode.NONE), **changes})

    return make


def test_the_journal_of_a_killed_run_is_recovered_beside_the_new_recording(request_of, tmp_path):
    folder = tmp_path / "run"
    folder.mkdir()
    with Journal(folder, JournalHeader("m", "r", HEADER.started, HEADER.axes)) as left:
        for k in range(7):
            left.sink(sample(k))
    phases = []
    result = execute(request_of(), Listener(phase=phases.append))
    assert result.error is None
    assert any("its 7 samples are now" in phase for phase in phases)
    assert len(read_recording(folder / "recording-recovered.h5")) == 7
    assert len(read_recording(folder / "recording.h5")) == len(result.recording)


def test_the_files_of_an_earlier_run_are_set_aside(request_of, machine, tmp_path):
    first = execute(request_of(), Listener())
    second = execute(request_of(simulated=SimulatedStage(machine, 2)), Listener())
    kept, new = tmp_path / "run" / "previous", tmp_path / "run"
    assert {p.name for p in kept.iterdir()} == {
        "recording.h5", "summary.json", "report.html", "bus.asc",
    }  # fmt: skip
    assert read_recording(kept / "recording.h5").started == first.recording.started
    assert read_recording(new / "recording.h5").started == second.recording.started


@pytest.fixture
def bus(machine):
    return driver_settings(machine)[0]


def test_a_real_stage_is_left_alone(request_of, bus):
    listener = Listener(switched_on=lambda *both: pytest.fail("there is no virtual stage"))
    with virtual_stage(request_of(), None, bus, listener) as found:
        assert found == (bus, ())


def test_the_virtual_drives_answer_on_the_bus_to_open(request_of, machine, bus):
    stages = []
    listener = Listener(switched_on=lambda *both: stages.extend(both))
    with virtual_stage(request_of(), stage_settings(machine), bus, listener) as (used, injected):
        nodes = [axis.node for axis in machine.axes.values()]
        assert [drive.node_id for drive in stages[0].drives] == nodes
        assert (used.interface, used.sync_period) == ("lockstep", bus.sync_period)
        assert injected == ()
        with open_bus(used) as opened:
            assert opened.recv(1.0).arbitration_id in (0x701, 0x702)  # a boot-up message


def test_two_runs_at_once_have_buses_of_their_own(request_of, machine, bus):
    settings = stage_settings(machine)
    with (
        virtual_stage(request_of(), settings, bus, Listener()) as (one, _),
        virtual_stage(request_of(), settings, bus, Listener()) as (other, _),
    ):
        assert one.channel != other.channel


def test_faults_are_listed_as_they_are_injected(request_of, machine, bus):
    lost = f.Drop(f.Frames(frozenset({0x80}), "host"))
    request = request_of(simulated=SimulatedStage(machine, faults=f.FaultPlan((lost,), 1)))
    with virtual_stage(request, stage_settings(machine), bus, Listener()) as (used, injected):
        assert [(entry.fault, entry.count) for entry in injected] == [(lost, 0)]
        with open_bus(used) as opened:
            for _ in range(3):
                opened.send(can.Message(arbitration_id=0x80, is_extended_id=False))
        assert [entry.count for entry in injected] == [3]


@pytest.fixture
def request_from(machine, tmp_path):
    def make(folder="run", friction_scale=1.0, **given):
        host = HostSettings(friction_scale=friction_scale)
        return request_for(machine, tmp_path / folder, host=host, **given)

    return make


def coulomb(request):
    told = []
    _, compensation = prepare(request, told.append)
    assert told == ["preparing the estimator"], "it takes long"
    return [axis.estimator.friction.coulomb for axis in compensation]


def test_a_run_starts_from_the_machine_file_scaled(request_from, machine):
    stated = [axis.plant.friction.coulomb for axis in machine.axes.values()]
    assert coulomb(request_from()) == pytest.approx(stated)
    assert coulomb(request_from(friction_scale=0.5)) == pytest.approx([0.5 * c for c in stated])


def test_a_resumed_run_starts_from_what_was_accepted_last(request_from, machine):
    resumed = Resumed("/a", "t", 1, {"y": {"coulomb": (7.5, 0.1)}})
    x, y = coulomb(request_from(resumed=resumed, friction_scale=0.5))
    assert y == pytest.approx(7.5)
    assert x == pytest.approx(0.5 * machine.axes["x"].plant.friction.coulomb)


def test_without_a_history_nothing_is_filed_and_none_is_made(request_from, tmp_path):
    told = []
    file_earlier_runs(request_from(), told.append)
    file_earlier_runs(request_from(history=str(tmp_path / "stage.db")), told.append)
    assert told == []
    assert not (tmp_path / "stage.db").exists()


def test_a_run_that_the_history_has_is_not_filed_again(request_from, tmp_path):
    where = tmp_path / "stage.db"
    execute(request_from("first", history=str(where)), Listener())
    told = []
    file_earlier_runs(request_from("second", history=str(where)), told.append)
    history = open_history(str(where))
    assert (len(history.runs(StageKey("wafer-xy", True))), told) == (1, [])
    history.close()
