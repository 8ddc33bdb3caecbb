"""What a run makes, and what it leaves alone where it cannot begin."""

import can
import pytest

from drivers.canopen import open_bus
from hil_sim.bus import faults as f
from stagectl.config import driver_settings, stage_settings
from stagectl.errors import UnusableInput
from stagectl.run import HostSettings, Listener, SimulatedStage, execute
from stagectl.run.execution import virtual_stage
from stagectl.sequencer import Mode
from stagectl.store import Journal, JournalHeader, read_recording
from tests.unit.stagectl.run.whole import request_for
from tests.unit.stagectl.store.journals import HEADER, sample


@pytest.fixture
def request_of(machine, tmp_path):
    def make(folder=tmp_path / "run", **changes):
        return request_for(machine, folder, **{"host": HostSettings(Mode.NONE), **changes})

    return make


def test_no_folder_is_made_before_the_bus_is_open(request_of, tmp_path):
    request = request_of(simulated=None, bus=("socketcan", "no-such-interface"))
    with pytest.raises(UnusableInput, match="no-such-interface"):
        execute(request, Listener())
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_made_is_named(request_of, tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(UnusableInput, match="file is not a folder"):
        execute(request_of(folder=tmp_path / "file" / "run"), Listener())


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
