"""Host and virtual drive together: block transfers both ways, SYNC with a counter."""

import dataclasses
import itertools

import can
import numpy as np
import pytest
from canopen import SdoAbortedError

from drivers.canopen import Network, SdoChannel
from drivers.errors import ConfigurationError
from drivers.settings import BusSettings
from drivers.stage import Stage
from hil_sim.bus import World
from hil_sim.stage import VirtualStage
from stagectl.config.machine.file import load_machine
from stagectl.config.settings.package_settings import driver_settings, stage_settings

_names = itertools.count()


@pytest.fixture(scope="module")
def machine():
    return load_machine()


@pytest.fixture
def world(machine):
    world = World(f"sdo-{next(_names)}")
    stage = VirtualStage(stage_settings(machine), seed=1)
    stage.attach(world)
    world.sleep_until_ns(50_000_000)
    return world, stage


def test_block_transfers_both_ways(world):
    with can.Bus(interface="lockstep", channel=world[0].name) as bus:
        channel = SdoChannel(Network(bus, "lockstep"), 1)
        assert channel.block_upload(0x1008, 0) == b"stagectl linear drive"
        assert channel.block_upload(0x1000, 0) == channel.upload(0x1000, 0)
        channel.block_download(0x607C, 0, b"\x15\xcd\x5b\x07")
        assert channel.upload(0x607C, 0) == (123456789).to_bytes(4, "little")
        with pytest.raises(SdoAbortedError, match="06070012"):
            channel.block_download(0x607C, 0, bytes(2000))
        with pytest.raises(SdoAbortedError, match="06010002"):
            channel.block_download(0x1008, 0, b"another name")
        assert channel.upload(0x607C, 0) == (123456789).to_bytes(4, "little")


def test_sync_with_a_counter(machine, world):
    bus, axes = driver_settings(machine)
    bus = dataclasses.replace(bus, interface="lockstep", channel=world[0].name, sync_counter=10)
    axes = tuple(dataclasses.replace(a, homing_method=37) for a in axes)
    counters = []

    def tap(time_ns, can_id, data):
        if can_id == 0x80:
            counters.append(data[0])

    with Stage.open(bus, axes, tap=tap) as stage:
        stage.boot()
        stage.home()
        stage.enable()
        assert stage.hold(0.05).valid.all()
    assert set(counters) == set(range(1, 11))
    assert set(np.diff(counters)) == {1, -9}
    # the next session wants none, and says so to the drives
    with Stage.open(dataclasses.replace(bus, sync_counter=0), axes) as stage:
        stage.boot()
        stage.enable()
        assert stage.hold(0.01).valid.all()


def test_a_counter_that_a_drive_does_not_support_is_refused(machine, world):
    bus, axes = driver_settings(machine)
    bus = dataclasses.replace(bus, interface="lockstep", channel=world[0].name, sync_counter=10)
    del world[1].drives[0].dictionary.variables[0x101900]
    with (
        Stage.open(bus, axes) as stage,
        pytest.raises(ConfigurationError, match=r"^axis x: 0x1019:00 .*is not offered"),
    ):
        stage.boot()


@pytest.mark.parametrize("counter", [1, -1, 241])
def test_impossible_counters_are_refused(counter):
    with pytest.raises(ConfigurationError, match="sync_counter"):
        BusSettings("virtual", "x", sync_counter=counter)
