"""The bus in virtual time, as python-can and canopen use it."""

import threading

import can
import pytest


def frame(can_id, data=b""):
    return can.Message(arbitration_id=can_id, data=data, is_extended_id=False)


def test_everything_that_follows_is_done_when_send_returns(bus):
    world = bus.world
    order = []
    world.subscribe(0x80, lambda d: (order.append("a"), world.emit(0x181, b"\x01")))
    world.subscribe(0x80, lambda d: (order.append("b"), world.emit(0x182, b"\x02")))
    world.subscribe(0x181, lambda d: order.append("c"))
    bus.send(frame(0x80))
    assert order == ["a", "b", "c"]  # first come, first delivered
    assert [bus.recv(0).arbitration_id for _ in range(2)] == [0x181, 0x182]
    assert bus.recv(0) is None


def test_only_waiting_moves_time(bus):
    bus.send(frame(1))
    assert bus.clock.now_ns() == 0
    assert bus.recv(3600.0) is None  # an hour that nobody waits for: a test is given 600 s
    assert bus.clock.now_ns() == 3600 * 10**9
    assert bus.recv(-1.0) is None
    assert bus.clock.now_ns() == 3600 * 10**9


def test_a_frame_ends_the_wait_at_its_time(bus):
    bus.world.at(7_000_000, lambda: bus.world.emit(0x700, b"\x05"))
    message = bus.recv(1.0)
    assert message.timestamp == pytest.approx(7e-3)
    assert bus.clock.now_ns() == 7_000_000


def test_recv_of_zero_runs_what_is_due_now(bus):
    world = bus.world
    bus.clock.sleep_until_ns(5)
    for can_id in (0x701, 0x702):
        world.at(5, lambda can_id=can_id: world.emit(can_id, b"\0"))
    assert bus.recv(0).arbitration_id == 0x701
    assert bus.recv(0).arbitration_id == 0x702
    assert bus.clock.now_ns() == 5


def test_hosts_hear_each_other_but_not_themselves(name, bus):
    with can.Bus(interface="lockstep", channel=name) as other:
        bus.send(frame(0x123, b"\x01\x02"))
        heard = other.recv(0)
        assert (heard.arbitration_id, bytes(heard.data), heard.is_rx) == (0x123, b"\x01\x02", True)
        assert bus.recv(0) is None
    with can.Bus(interface="lockstep", channel=name, receive_own_messages=True) as echo:
        echo.send(frame(0x7))
        assert not echo.recv(0).is_rx
        echo.world.emit(0x181, b"")  # a node's frame
        assert echo.recv(0).is_rx


def test_filters(bus):
    bus.set_filters([{"can_id": 0x80, "can_mask": 0x7FF}])
    bus.world.emit(0x81, b"")
    bus.world.emit(0x80, b"")
    assert bus.recv(0).arbitration_id == 0x80
    assert bus.recv(0) is None


def test_periodic_sending_in_virtual_time(name, bus):
    with can.Bus(interface="lockstep", channel=name) as other:
        task = bus.send_periodic(frame(0x80), 0.001)
        bus.clock.sleep_until_ns(10_000_000)
        task.stop()
        bus.clock.sleep_until_ns(20_000_000)
        stamps = []
        while (message := other.recv(0)) is not None:
            stamps.append(round(message.timestamp * 1e9))
        assert stamps == [k * 1_000_000 for k in range(11)]


def test_periodic_sending_for_a_duration(name, bus):
    with can.Bus(interface="lockstep", channel=name) as other:
        bus.send_periodic(frame(0x80), 0.001, duration=0.003)
        bus.clock.sleep_until_ns(10_000_000)
        assert len([1 for _ in range(9) if other.recv(0)]) == 3


def test_foreign_thread_is_refused(bus):
    errors = []

    def foreign():
        try:
            bus.recv(1.0)
        except can.CanOperationError as error:
            errors.append(str(error))

    thread = threading.Thread(target=foreign)
    thread.start()
    thread.join()
    assert len(errors) == 1
    assert "a thread other than" in errors[0]
    assert bus.clock.now_ns() == 0


def test_closed_bus_is_refused(name):
    bus = can.Bus(interface="lockstep", channel=name)
    bus.shutdown()
    bus.shutdown()
    with pytest.raises(can.CanOperationError, match="closed"):
        bus.send(frame(1))
