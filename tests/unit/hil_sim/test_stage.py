"""The stage as a whole, on the simulated plant."""

import struct

import can
import numpy as np
import pytest

from hil_sim.stage import START_RANGE, VirtualStage, draw_start_positions


def test_start_positions_come_from_the_seed(stage_settings):
    one = draw_start_positions(stage_settings, 1)
    assert one == draw_start_positions(stage_settings, 1) != draw_start_positions(stage_settings, 2)
    assert all(abs(x) <= START_RANGE for x in one)
    assert all(x / 1e-9 == pytest.approx(round(x / 1e-9), abs=1e-6) for x in one)
    drawn = [x for seed in range(200) for x in draw_start_positions(stage_settings, seed)]
    assert min(drawn) < -0.9 * START_RANGE
    assert max(drawn) > 0.9 * START_RANGE


def test_attached_once(stage, world):
    with pytest.raises(ValueError, match="already"):
        stage.attach(world)


def test_wrong_number_of_start_positions(stage_settings, plant):
    with pytest.raises(ValueError, match="one position per axis"):
        VirtualStage(stage_settings, 1, start=(0.0,), plant=plant)


def test_csp_over_can_is_the_compiled_simulation(stage_settings, world, make_host):
    """Frames add nothing: the same samples as `simulate`, to the nanometre and the permille."""
    from hil_sim.plant import simulate

    stage = VirtualStage(stage_settings, seed=None, start=(0.0, 0.0))
    stage.attach(world)
    k = np.arange(200)
    targets = np.stack([np.clip(k - 20, 0, 100) * 400, np.clip(k - 50, 0, 80) * -250], axis=1)
    offsets = np.where((k > 20) & (k < 120), 90, -15)[:, None] * np.array([1, -1])
    targets[0] = offsets[0] = 0
    with can.Bus(interface="lockstep", channel=world.name) as bus:
        host = make_host(bus)
        host.wait(30)
        host.map_for_csp()
        for node in (1, 2):
            host.enable(8, node)
        host.nmt(1)
        rows = []
        for target, offset in zip(targets.tolist(), offsets.tolist(), strict=True):
            for node in (1, 2):
                pair = struct.pack("<Hih", 0x0F, target[node - 1], offset[node - 1])
                host.send(0x200 + node, pair)
            host.send(0x080)
            rows.append([struct.unpack("<Hih", host.take(0x180 + n)[0].data)[1:] for n in (1, 2)])
            host.wait(1)
    sampled = np.array(rows)
    expected = simulate(stage_settings, targets * 1e-9, offsets * 0.04, seed=None)
    assert np.abs(sampled[:, :, 0] - expected.position * 1e9).max() < 0.01
    assert np.abs(sampled[:, :, 1] - expected.force / 0.04).max() < 0.01
    assert np.ptp(sampled[:, 0, 0]) > 39_000
