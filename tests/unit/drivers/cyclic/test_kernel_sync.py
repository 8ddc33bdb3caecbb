"""What the kernel is asked to send; that it does so is tested on a SocketCAN bus (tests/hil)."""

import socket

import can
import pytest

from drivers.cyclic.kernel_sync import KernelSync


class Task:
    def __init__(self):
        self.stopped = 0

    def stop(self):
        self.stopped += 1
        raise can.CanOperationError("gone")


class Bus:
    """A bus with a socket and a broadcast manager."""

    def __init__(self, own):
        self.socket, self.asked, self.task = own, [], Task()

    def send_periodic(self, messages, period, store_task):
        self.asked.append((messages, period, store_task))
        return self.task


@pytest.fixture
def bus():
    one, other = socket.socketpair()
    with one, other:
        yield Bus(one)


def test_sync_without_a_counter_is_empty(bus):
    KernelSync(bus, 1000, 0).start()
    ((messages, _, _),) = bus.asked
    assert [(m.arbitration_id, bytes(m.data)) for m in messages] == [(0x80, b"")]


def test_the_counter_runs_from_1_to_its_overflow(bus):
    KernelSync(bus, 250, 4).start()
    ((messages, _, _),) = bus.asked
    assert [bytes(m.data) for m in messages] == [b"\1", b"\2", b"\3", b"\4"]


@pytest.mark.parametrize("period_us", [125, 333, 1000, 4001])
def test_no_period_is_a_microsecond_short(bus, period_us):
    KernelSync(bus, period_us, 0).start()
    assert int(bus.asked[0][1] * 1e6) == period_us  # python-can truncates


def test_it_is_started_once_and_stopping_never_fails(bus):
    sync = KernelSync(bus, 1000, 0)
    sync.stop()
    sync.start()
    sync.start()
    assert len(bus.asked) == 1
    sync.stop()
    sync.stop()
    assert bus.task.stopped == 1


def test_other_buses_have_no_kernel_that_sends(bus):
    assert not KernelSync.fits(bus)
    assert not KernelSync.fits(object())
