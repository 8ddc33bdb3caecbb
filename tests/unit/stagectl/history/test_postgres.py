"""A connection that does not answer is cut, and only then."""

import socket

import pytest

from stagectl.history.postgres import Watchdog

LONG = 1000.0


@pytest.fixture
def pair():
    ours, theirs = socket.socketpair()
    with ours, theirs:
        yield ours, theirs


def test_whoever_waits_too_long_gets_an_end_instead(pair):
    ours, theirs = pair
    dog = Watchdog(ours.fileno(), patience=0.01)
    with dog:
        assert ours.recv(1) == b""  # would wait for ever
    assert dog.cut
    assert theirs.recv(1) == b""


def test_an_answer_in_time_leaves_the_connection(pair):
    ours, theirs = pair
    dog = Watchdog(ours.fileno(), patience=LONG)
    theirs.send(b"a")
    with dog:
        assert ours.recv(1) == b"a"
    dog.close()
    dog.close()  # idempotent
    ours.send(b"b")
    assert theirs.recv(1) == b"b"
    assert not dog.cut


def test_after_a_wait_inside_another_one_the_outer_one_goes_on(pair):
    ours, _ = pair
    dog = Watchdog(ours.fileno(), patience=LONG)
    with dog:
        with dog:
            pass
        dog.patience = 0.01
        with dog:
            pass  # begins the outer wait again, with the present patience
        assert ours.recv(1) == b""
    assert dog.cut


def test_nothing_is_cut_between_waits(pair):
    ours, theirs = pair
    dog = Watchdog(ours.fileno(), patience=0.0)
    theirs.settimeout(0.6)  # two looks
    with pytest.raises(TimeoutError):
        theirs.recv(1)
    assert not dog.cut
    dog.close()
