"""The pytest fixtures for users: virtual time, one thread, identical bytes in every run."""

import hashlib
import threading

import can
import canopen
import numpy as np
import pytest

from drivers.stage import Stage
from hil_sim.bus import LockstepBus, World
from hil_sim.stage import VirtualStage
from stagectl.config.settings.package_settings import driver_settings, stage_settings
from tests.lockstep import power_up


def test_virtual_stage_is_ready_to_stream(virtual_stage, hold):
    samples = virtual_stage.stream(*hold(virtual_stage, 200))
    assert len(samples) == 200
    assert samples.valid.all()
    assert not samples.late.any()
    np.testing.assert_array_equal(np.round(samples.time * 1e3), np.arange(200))


def test_virtual_drives_expose_the_plant(virtual_stage, virtual_drives, travel_to, hold):
    virtual_stage.stream(*travel_to(virtual_stage, (1e-3, 2e-3), 0.2, 1e-3))
    samples = virtual_stage.stream(*hold(virtual_stage, 300))
    counts = [virtual_drives.plant.encoder(axis) for axis in (0, 1)]
    np.testing.assert_allclose(np.array(counts) * 1e-9, samples.position[-1], atol=10e-9)


def test_any_canopen_master_can_use_the_bus(stage_bus, stage_machine):
    """The one that canopen is itself, without its Notifier thread, fed by hand."""
    _, axes = driver_settings(stage_machine)
    network = canopen.Network(stage_bus)
    states = []
    node = network.add_node(axes[0].node, str(axes[0].eds))
    node.nmt.add_heartbeat_callback(states.append)
    node.nmt.state = "RESET COMMUNICATION"
    for _ in range(20):
        message = stage_bus.recv(0.1)
        if message is not None:
            network.notify(message.arbitration_id, message.data, message.timestamp)
    assert 0 in states
    assert stage_bus.clock.now_ns() > 0


def run(machine, seed, travel_to, hold):
    """Digests of everything on the bus and of every sample, of one whole session."""
    frames, samples = hashlib.sha256(), hashlib.sha256()
    world = World("same-bytes")
    VirtualStage(stage_settings(machine), seed).attach(world)
    bus, axes = driver_settings(machine)

    def tap(t, can_id, data):
        frames.update(b"%d %d %s\n" % (t, can_id, data))

    with (
        LockstepBus(channel="same-bytes") as opened,
        Stage.open(bus, axes, tap=tap, bus_object=opened) as stage,
    ):
        stage.sink = lambda sample: samples.update(repr(sample).encode())
        power_up(stage)
        stage.stream(*travel_to(stage, (2e-3, -1e-3), 0.2, 1e-3))
        stage.stream(*hold(stage, 100))
    return frames.hexdigest(), samples.hexdigest()


def test_two_runs_give_the_same_bytes_and_another_seed_does_not(stage_machine, travel_to, hold):
    first = run(stage_machine, 7, travel_to, hold)
    assert run(stage_machine, 7, travel_to, hold) == first
    other = run(stage_machine, 8, travel_to, hold)
    assert other[0] != first[0]
    assert other[1] != first[1]


def test_no_thread_is_started(virtual_stage, hold):
    before = threading.active_count()
    virtual_stage.stream(*hold(virtual_stage, 50))
    virtual_stage.idle(0.5)
    assert threading.active_count() == before


homed = []


@pytest.mark.parametrize("step", [1, 2, 3])
def test_one_stage_for_a_module_is_homed_once(module_stage, hold, step):
    homed.append(module_stage)
    assert homed == [module_stage] * step  # the same one
    start = np.array(module_stage.targets)
    s = np.linspace(0.0, 1.0, 201)[1:, None]
    demand = start + 1e-4 * s**3 * (10 - 15 * s + 6 * s**2)
    module_stage.stream(demand, np.zeros_like(demand))
    np.testing.assert_allclose(module_stage.targets, start + 1e-4, atol=2e-9)


@pytest.mark.real_time
def test_a_master_with_a_notifier_thread_finds_the_drives(served_drives, stage_machine):
    _, axes = driver_settings(stage_machine)
    network = canopen.Network()
    network.connect(**served_drives)  # starts a can.Notifier
    try:
        node = network.add_node(axes[0].node, str(axes[0].eds))
        assert node.sdo[0x1000].raw == 0x00020192
        booted = threading.Event()
        node.nmt.add_heartbeat_callback(lambda state: booted.set() if state == 0 else None)
        node.nmt.state = "RESET"
        assert booted.wait(60.0)
    finally:
        network.disconnect()


@pytest.mark.real_time
def test_a_plain_notifier_hears_the_drives(served_drives):
    heard = can.BufferedReader()
    with can.Bus(**served_drives) as bus:
        notifier = can.Notifier(bus, [heard])
        assert heard.get_message(0.0) is None  # the drives have booted before
        bus.send(can.Message(arbitration_id=0, data=[0x81, 2], is_extended_id=False))
        message = heard.get_message(60.0)
        notifier.stop()
    assert message is not None
    assert (message.arbitration_id, bytes(message.data)) == (0x702, b"\0")
