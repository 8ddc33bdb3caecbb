"""Parts of the state that are not samples: bus load, STO and brake."""

import time
from types import SimpleNamespace

import pytest

from drivers.errors import NodeError
from stagectl.server import snapshot
from stagectl.server.handover import Handover
from stagectl.server.snapshot import DriveSignals


def test_bus_load_is_the_share_of_time_that_frames_take(monkeypatch):
    now = [10.0]
    monkeypatch.setattr(snapshot.time, "monotonic", lambda: now[0])
    handover, load = Handover(), snapshot.BusLoad(1_000_000)
    assert load.of(handover.bits) is None
    for _ in range(1000):
        handover.frame(0, 0x80, b"")  # 47 bits, and 8 stuff bits at most
        handover.frame(0, 0x201, bytes(8))  # 111 and 24
    now[0] += 1.0
    assert load.of(handover.bits) == pytest.approx((55 + 135) * 1000 / 1e6)
    now[0] += 0.1
    assert load.of(0) == pytest.approx(0.19), "averaged over half a second at least"


class Drive:
    """A drive's node: what it answers, or the error that it raises."""

    def __init__(self, **answers):
        self.answers, self.asked = answers, []

    def read_if_offered(self, obj):
        self.asked.append(obj.index)
        answer = self.answers.get(f"o{obj.index:x}")
        if isinstance(answer, Exception):
            raise answer
        return answer


def read(signals, drives, known):
    """Have the drives, on axes 0, 1, ..., read until this is known."""
    stage = SimpleNamespace(
        axes=tuple(SimpleNamespace(name=str(k), node=drive) for k, drive in enumerate(drives))
    )
    deadline = time.monotonic() + 10
    while not known() and time.monotonic() < deadline:
        signals.turn(stage)
        time.sleep(0.01)


def test_sto_and_brake_are_what_each_drive_reports_and_no_more():
    signals = DriveSignals(period=0.0)
    silent = Drive(o60fd=NodeError("silent"), o60fe=NodeError("silent"))
    drives = [Drive(o60fd=1 << 3, o60fe=1), Drive(o60fd=3, o60fe=2), Drive(), silent]
    read(signals, drives, lambda: signals.brake("1") is False)
    assert [signals.safe_torque_off(str(k)) for k in range(4)] == [True, False, None, None]
    assert [signals.brake(str(k)) for k in range(4)] == [True, False, None, None]
    silent.answers = {"o60fd": 0, "o60fe": 0}
    read(signals, drives, lambda: signals.safe_torque_off("3") is not None)
    assert signals.safe_torque_off("3") is False, "asked again, since it was only silent"
    assert drives[2].asked == [0x60FD, 0x60FE], "not asked again for what it does not have"
    signals.turn(None)
    assert signals.safe_torque_off("0") is None, "nothing is known without a stage"
    signals.close()


def test_following_error_is_against_the_demand_that_the_drive_had_when_it_was_sampled():
    """0.1 m/s, SYNC every 1 ms: 100 um a row, of which 10 um are taken 0.1 ms after SYNC."""
    axis = SimpleNamespace(name="x", increment=1e-9, force_unit=1e-3, homed=True)
    stage = SimpleNamespace(
        axes=(axis,), enabled=True, statuswords=(0x1237,), positions=(0.0,), targets=(0.0,),
        forces=(0.0,), offsets=(0.0,),
    )  # fmt: skip
    sampling, signals = snapshot.Sampling(ratio=0.1), DriveSignals()
    for row in range(1, 4):
        demand = row * 100_000
        head, tail = (row * 1_000_000, 0, 0, -1), (0x1237, 1, 0, 0)
        sampling.block(stage, [(*head, demand, 0, demand - 90_000 - 7, 0, *tail)])
    assert sampling.axes(stage, signals)[0].error == pytest.approx(7e-9)
    signals.close()
