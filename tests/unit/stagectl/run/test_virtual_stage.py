"""The bus of a run: the machine's, or that of a virtual stage switched on for it."""

from datetime import UTC, datetime

import can
import pytest

from drivers.canopen import open_bus
from hil_sim.bus import faults as f
from stagectl.config import driver_settings, stage_settings
from stagectl.recipe import parse_recipe
from stagectl.run import HostSettings, RunRequest, SimulatedStage
from stagectl.run.virtual_stage import virtual_stage
from stagectl.sequencer import Mode
from tests.short_recipe import short_recipe


@pytest.fixture
def request_of(machine, tmp_path):
    recipe = parse_recipe(short_recipe((0.01, 0.0)), "r.yaml", machine)

    def make(**changes):
        return RunRequest(
            recipe,
            machine,
            tmp_path,
            datetime.now(UTC),
            simulated=SimulatedStage(machine, 3, **changes),
            host=HostSettings(mode=Mode.NONE),
        )

    return make


@pytest.fixture
def bus(machine):
    return driver_settings(machine)[0]


def test_a_real_stage_is_left_alone(request_of, bus):
    switched = []
    with virtual_stage(request_of(), None, bus, lambda *both: switched.append(both)) as found:
        assert found == (bus, ())
    assert switched == []


def test_the_virtual_drives_answer_on_the_bus_to_open(request_of, machine, bus):
    switched = []
    settings = stage_settings(machine)
    with virtual_stage(request_of(), settings, bus, lambda *both: switched.append(both)) as (
        used,
        injected,
    ):
        ((stage, _),) = switched
        assert [drive.node_id for drive in stage.drives] == [
            axis.node for axis in machine.axes.values()
        ]
        assert (used.interface, used.sync_period) == ("lockstep", bus.sync_period)
        assert injected == ()
        with open_bus(used) as opened:
            boot_up = opened.recv(1.0)
            assert boot_up is not None
            assert boot_up.arbitration_id in (0x701, 0x702)


def test_two_runs_at_once_have_buses_of_their_own(request_of, machine, bus):
    settings = stage_settings(machine)
    with (
        virtual_stage(request_of(), settings, bus, lambda *_: None) as (one, _),
        virtual_stage(request_of(), settings, bus, lambda *_: None) as (other, _),
    ):
        assert one.channel != other.channel


def test_faults_are_listed_as_they_are_injected(request_of, machine, bus):
    lost = f.Drop(f.Frames(frozenset({0x80}), "host"))
    request = request_of(faults=f.FaultPlan((lost,), 1))
    with virtual_stage(request, stage_settings(machine), bus, lambda *_: None) as (used, injected):
        assert [(entry.fault, entry.count) for entry in injected] == [(lost, 0)]
        with open_bus(used) as opened:
            for _ in range(3):
                opened.send(can.Message(arbitration_id=0x80, is_extended_id=False))
        assert [entry.count for entry in injected] == [3]
