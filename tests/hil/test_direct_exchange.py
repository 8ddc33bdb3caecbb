"""Whole SYNCs at once on the lock-step bus: the same frames and samples as step by step."""

import dataclasses

import numpy as np
import pytest

from drivers import objects as od
from drivers.errors import DriverError
from drivers.stage import Stage
from hil_sim.bus import LockstepBus
from hil_sim.bus import faults as f
from stagectl.config.settings.observer import design_observers, make_observer
from stagectl.config.settings.package_settings import driver_settings
from stagectl.sequencer import ObservedOffsets
from stagedata import Samples
from tests.lockstep import power_up, switch_on

STATUSWORD = [field.name for field in dataclasses.fields(Samples)].index("statusword")
COUNT = 500
"""Of SYNCs: all heartbeats and the host's service fall due several times."""


class StepByStep(LockstepBus):
    """The same bus, and nothing but python-can's interface to it."""

    exchange = None


class Counted(LockstepBus):
    """Counts the SYNCs that were exchanged at once."""

    at_once = 0

    def exchange(self, *arguments):
        answers = super().exchange(*arguments)
        self.at_once += bool(answers)
        return answers


class Run:
    """A stage on a bus of this kind; what it sent, received and sampled."""

    def __init__(self, machine, kind, faults=(), count_sync=False, homing=37):
        self.frames, self.samples, self.failure = [], [], None
        self.streams = []
        bus, axes = driver_settings(machine)
        self.drives, self.world = switch_on(machine, *faults, start=(-5e-4, -4e-4))
        bus = dataclasses.replace(bus, sync_counter=10 if count_sync else 0)
        self.bus = kind(channel=self.world.name)
        axes = [dataclasses.replace(axis, homing_method=homing) for axis in axes]
        self.stage = Stage.open(bus, axes, self.note, self.bus)
        self.stage.sink = self.samples.append
        power_up(self.stage)

    def note(self, t_ns, can_id, data):
        self.frames.append((t_ns, can_id, bytes(data)))

    def at(self, seconds, action):
        """After so much time from now."""
        self.world.at(self.world.now_ns + round(seconds * 1e9), action)

    def observe(self, machine):
        peaks = [axis.settings.peak_force for axis in self.stage.axes]
        observer = make_observer(machine, design_observers(machine), peaks)
        self.stage.correct_offsets(ObservedOffsets(observer))

    def stream(self, until=None):
        """There and back by 1 mm on x and half of that on y."""
        way = 0.5e-3 * (1 - np.cos(2 * np.pi * np.arange(1, COUNT + 1) / COUNT))
        position = np.array(self.stage.targets) + way[:, None] * [1.0, 0.5]
        try:
            samples = self.stage.stream(position, np.full((COUNT, 2), 0.3), until)
            self.streams.append(dataclasses.astuple(samples))
        except DriverError as error:
            self.failure = str(error).replace(self.world.name, "")

    def end(self):
        self.stage.close()
        self.bus.shutdown()


def in_both_ways(machine, act, **options):
    """What `act` does with a stage, step by step and at once."""
    single, direct = runs = [made(machine, kind, act, **options) for kind in (StepByStep, Counted)]
    assert_equal(*runs)
    assert (direct.samples == single.samples) is True
    assert len(direct.samples) >= 100
    return direct


def made(machine, kind, act, **options):
    run = Run(machine, kind, **options)
    act(run)
    run.end()
    return run


def assert_equal(single, other):
    pairs = zip(single.frames, other.frames, strict=False)
    assert next((pair for pair in pairs if pair[0] != pair[1]), None) is None
    assert len(other.frames) == len(single.frames)
    assert other.failure == single.failure
    assert len(other.streams) == len(single.streams)
    for one, two in zip(single.streams, other.streams, strict=True):
        for values, same in zip(one, two, strict=True):
            assert values.dtype == same.dtype
            np.testing.assert_array_equal(values, same)


def test_a_stream_writes_the_same_frames_and_samples(stage_machine):
    run = in_both_ways(stage_machine, lambda run: (run.stream(), run.stream()))
    assert len(run.samples) == 2 * COUNT
    assert run.bus.at_once > 0.9 * len(run.samples)


def test_an_interrupt_ends_a_stream_as_step_by_step(stage_machine):
    """Between two SYNCs, by whoever's timer."""

    def act(run):
        def interrupt():
            raise KeyboardInterrupt

        run.at(0.2003, interrupt)
        try:
            run.stream()
        except KeyboardInterrupt:
            run.failure = "interrupted"

    run = in_both_ways(stage_machine, act)
    assert run.failure == "interrupted"


def test_a_target_beyond_the_drives_own_limit_is_cut_as_step_by_step(stage_machine):
    def act(run):
        drive = run.drives.drives[0]
        limit = round((run.stage.targets[0] + 0.5e-3) * 1e9)

        def lower():
            drive.dictionary.set_data(0x607D, 2, limit.to_bytes(4, "little", signed=True))

        run.at(0.1003, lower)
        run.stream()

    run = in_both_ways(stage_machine, act)
    assert len({int(word) for word in run.streams[0][STATUSWORD][:, 0]}) > 1


def test_velocities_are_streamed_as_step_by_step(stage_machine):
    def act(run):
        velocity = 0.01 * np.sin(np.linspace(0.0, np.pi, COUNT))[:, None] * [1.0, -1.0]
        velocity[-1] = 0.0
        run.streams.append(dataclasses.astuple(run.stage.stream_velocity(velocity)))
        run.stage.enable()
        run.stream()

    assert in_both_ways(stage_machine, act).bus.at_once > COUNT


def test_a_stage_stops_as_step_by_step(stage_machine):
    """By a quick stop between two streams, and one of a drive inside the second."""

    def act(run):
        run.stream()
        run.stage.quick_stop()
        run.stage.enable()
        drive = run.drives.drives[0]
        run.at(0.2003, lambda: drive.dictionary.set_data(0x6040, 0, b"\2\0"))
        run.stream()

    run = in_both_ways(stage_machine, act)
    assert "QUICK STOP" in run.failure.upper()


def test_an_observed_stream_gets_the_same_offsets_and_samples(stage_machine):
    def act(run):
        run.observe(stage_machine)
        run.stream()

    run = in_both_ways(stage_machine, act)
    assert len({sample[5] for sample in run.samples}) > 5  # offsets of axis x
    assert run.bus.at_once > 0.9 * len(run.samples)


def test_until_is_asked_after_every_sync(stage_machine):
    asked = {}

    def act(run):
        positions = asked[run] = []

        def until(position):
            positions.append(position)
            return len(positions) == 333

        run.stream(until)

    run = in_both_ways(stage_machine, act)
    single, direct = asked.values()
    assert direct == single
    assert len(run.samples) == len(direct) == 333


def test_an_object_read_between_two_syncs_does_not_disturb_them(stage_machine):
    read = {}

    def act(run):
        values = read[run] = []
        node = run.stage.axes[0].node

        def until(position):
            if len(run.samples) % 100 == 50:
                values.append(node.read(od.STATUSWORD))
            return False

        run.stream(until)

    in_both_ways(stage_machine, act)
    single, direct = read.values()
    assert len(direct) == 5
    assert direct == single


def narrow(run, axis):
    """A following error at the next SYNC; its EMCY comes before, or after, the last TPDO."""
    run.drives.drives[axis].dictionary.set_data(0x6065, 0, b"\2\0\0\0")


STRIKES = {
    "drive fault": (lambda run: run.drives.drives[1].inject_fault(0x2310), "0x2310"),
    "emcy": (lambda run: run.drives.drives[0].emergency.announce(0x8130), "0x8130"),
    "torque off": (lambda run: run.drives.drives[0].safe_torque_off(True), "axis x"),
    "nmt reset": (lambda run: run.world.emit(0x000, bytes((129, 1))), "another host"),
    "second tpdo": (lambda run: run.world.emit(0x181, bytes(8)), None),
    "short tpdo": (lambda run: run.world.emit(0x181, bytes(5)), None),
    "no heartbeat": (
        lambda run: setattr(run.drives.drives[1].nmt, "_beat", lambda due: None), "heartbeat"
    ),
    "following error of x": (lambda run: narrow(run, 0), "axis x: emergency: following error"),
    "following error of y": (lambda run: narrow(run, 1), "axis y: emergency: following error"),
}  # fmt: skip


@pytest.mark.parametrize("strike", STRIKES)
@pytest.mark.parametrize("after", [0.1, 0.1003], ids=["at SYNC", "between SYNCs"])
def test_a_fault_in_a_stream_ends_it_as_step_by_step(stage_machine, strike, after):
    act, said = STRIKES[strike]
    failure = in_both_ways(
        stage_machine, lambda run: (run.at(after, lambda: act(run)), run.stream())
    ).failure
    assert (failure is None) if said is None else said in failure


def test_a_frame_that_waits_is_taken_before_the_next_sync(stage_machine):
    def act(run):
        def until(position):
            if len(run.samples) == 333:
                run.drives.drives[1].emergency.announce(0x2310)
            return False

        run.stream(until)

    run = in_both_ways(stage_machine, act)
    assert "0x2310" in run.failure


def test_a_tpdo_that_comes_twice_now_and_then_is_forgotten(stage_machine):
    def act(run):
        sent = [b""]
        run.world.subscribe(0x181, lambda data: sent.append(data))

        def repeat():
            run.world.emit(0x181, sent[-1])

        for n in range(60):
            run.at(0.0203 + n * 0.002, repeat)
        run.stream()

    run = in_both_ways(stage_machine, act)
    assert run.failure is None
    assert run.streams[0][-1][:, 0].sum() == 60  # counted for axis x


def test_frames_lost_and_doubled_are_treated_as_step_by_step(stage_machine):
    frames = f.Frames(frozenset({0x181, 0x182}), "drives", after=0.5, probability=0.02)
    run = in_both_ways(
        stage_machine, lambda run: run.stream(), faults=(f.Drop(frames), f.Duplicate(frames))
    )
    assert run.bus.at_once == 0


def test_homing_on_the_index_takes_the_same_steps(stage_machine):
    run = in_both_ways(stage_machine, lambda run: run.stream(), homing=34)
    assert run.bus.at_once > len(run.samples) + 200  # drives make their profile on timers


def test_a_sync_counter_counts_on(stage_machine):
    run = in_both_ways(stage_machine, lambda run: run.stream(), count_sync=True)
    counts = [data[0] for _, can_id, data in run.frames if can_id == 0x80][-COUNT:]
    assert set(np.diff(counts)) == {1, -9}
