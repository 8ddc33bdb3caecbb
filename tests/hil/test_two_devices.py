"""Two drives with one node id on one bus: refused before power, stopped where it shows later.

The second stage receives all that the first one receives. Its frames may be kept from the host, so
that boot-up messages, SDO answers and TPDOs are tested one by one.
"""

import itertools
from contextlib import contextmanager
from functools import partial

import numpy as np
import pytest

from drivers.errors import AxisFault, NodeError
from hil_sim.bus import faults as f
from hil_sim.cia402 import State
from hil_sim.stage import VirtualStage
from stagectl.config.settings.package_settings import stage_settings
from tests.lockstep import Altered, open_stage, power_up

BOOT_UP, SDO, TPDO = 0x701, 0x581, 0x181


@contextmanager
def twins(machine, *heard):
    """A stage, its drives, and the bus of second drives of which these CAN-IDs are heard."""
    ids = set(heard)

    def muffle(can_id, data):
        return data if can_id in ids and not (can_id == BOOT_UP and data != b"\0") else None

    stage, drives, world = open_stage(machine)
    muffled = Altered(world, muffle)
    muffled.ids = ids
    VirtualStage(stage_settings(machine), seed=2).attach(muffled)
    with stage:
        yield stage, drives, muffled


@pytest.mark.parametrize(
    ("heard", "said"),
    [
        ([BOOT_UP], "2 boot-up messages after one reset"),
        ([SDO], "2 answers to one SDO request"),
        ([BOOT_UP, SDO, TPDO], "2 boot-up messages after one reset"),
    ],
)
def test_two_devices_are_refused_before_power(stage_machine, heard, said):
    with twins(stage_machine, *heard) as (stage, drives, _):
        with pytest.raises(NodeError, match=f"^axis x: {said}.* node id 1"):
            stage.boot()
        assert {d.motion.state for d in drives.drives} == {State.SWITCH_ON_DISABLED}


@pytest.mark.parametrize("heard", [[BOOT_UP], [SDO], [BOOT_UP, SDO, TPDO]])
def test_nothing_is_written_to_a_node_id_of_two_devices(stage_machine, heard):
    with twins(stage_machine, *heard) as (stage, drives, _):
        written = []
        for drive in drives.drives:
            server = drive.dictionary
            store = server.set_data
            server.set_data = lambda *a, store=store, **k: (written.append(a), store(*a, **k))
        with pytest.raises(NodeError, match="do two devices have node id 1"):
            stage.boot()
        assert not written


def test_a_second_boot_up_message_that_comes_late_is_noticed(stage_machine):
    """They come while the first drive is set up, 23 ms after its own."""
    with twins(stage_machine) as (stage, drives, muffled):
        own = itertools.cycle([True, False])

        def follow(data):
            if data == b"\0" and next(own):
                muffled.at(muffled.now_ns + 23_000_000, partial(muffled.world.emit, BOOT_UP, data))

        muffled.subscribe(BOOT_UP, follow)
        with pytest.raises(NodeError, match=r"^axis x: 2 boot-up messages after one reset"):
            stage.boot()
        assert {d.motion.state for d in drives.drives} == {State.SWITCH_ON_DISABLED}


def test_tpdos_of_two_devices_are_noticed_before_power(stage_machine):
    with twins(stage_machine, TPDO) as (stage, drives, _):
        stage.boot()
        with pytest.raises(AxisFault, match=r"^axis x: .*more than one TPDO 0x181 .* node id 1\?"):
            stage.enable()
        assert {d.motion.state for d in drives.drives} == {State.SWITCH_ON_DISABLED}


def test_tpdos_of_two_devices_stop_the_axes_and_make_no_samples(stage_machine):
    with twins(stage_machine) as (stage, drives, muffled):
        power_up(stage)
        samples = []
        stage.sink = samples.append
        rows = np.tile(stage.targets, (100, 1))
        count = itertools.count()

        def until(_):
            if next(count) == 20:
                muffled.ids.add(TPDO)
            return False

        with pytest.raises(AxisFault, match=r"^axis x: .*more than one TPDO 0x181 .* node id 1\?"):
            stage.stream(rows, np.zeros_like(rows), until)
        valid = np.array([s[9] for s in samples], dtype=bool)
        position = np.array([s[6] for s in samples])
        assert not any(d.motion.state is State.ENABLED for d in drives.drives)
    assert len(samples) <= 30
    assert valid[:21].all()
    assert not valid[21:].any()
    assert (position[21:] == position[20]).all()


def test_an_occasional_duplicate_frame_stops_nothing(stage_machine):
    every = f.Duplicate(f.Frames(probability=0.05), copies=2)
    with open_stage(stage_machine, every)[0] as stage:
        power_up(stage)
        samples = stage.hold(1.0)
    assert samples.extra.sum() > 50
    assert samples.valid.all()


@pytest.mark.parametrize("least", [0.2e-3, 1.2e-3])
def test_late_tpdos_do_not_count_as_doubled(stage_machine, least):
    """Some come for a SYNC after theirs: two for that one, and none for their own."""
    late = f.Delay(
        f.Frames(frozenset({0x181, 0x182}), "drives", after=1.5, probability=0.3), least, 2.4e-3
    )
    with open_stage(stage_machine, late)[0] as stage:
        power_up(stage)
        stage.hold(3.0)
        assert stage.enabled


def test_a_second_sync_is_named_by_the_tpdos_of_all_axes(stage_machine):
    second = f.Duplicate(f.Frames(frozenset({0x80}), "host"))
    with open_stage(stage_machine, second)[0] as stage:
        stage.boot()
        with pytest.raises(AxisFault, match="from the other axes: a second SYNC"):
            stage.home()
