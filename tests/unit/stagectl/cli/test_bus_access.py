"""Ctrl-C during bench commands: the first stops the drives, further ones are ignored."""

import os
import signal

import click
import pytest

from stagectl.cli.bus_access import interruptible


@pytest.fixture(autouse=True)
def handlers():
    before = {n: signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


def stop_twice(number: int) -> None:
    """One signal amid the motion, one amid the stop that it brings about."""
    with interruptible():
        try:
            os.kill(os.getpid(), number)
        finally:
            os.kill(os.getpid(), number)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_second_ctrl_c_does_not_interrupt_the_stop(number):
    with pytest.raises(click.exceptions.Abort) as ended:
        stop_twice(number)
    # one exception alone: the second raised none on the way out
    assert ended.value.__context__ is None or ended.value.__context__.__context__ is None
    os.kill(os.getpid(), number)  # the bus is being closed: this is not the moment either


def test_without_ctrl_c_the_handlers_are_restored():
    before = signal.getsignal(signal.SIGINT)
    with interruptible() as stopped:
        assert not stopped()
    assert signal.getsignal(signal.SIGINT) is before


def test_ctrl_c_only_sets_the_flag_once_it_is_polled():
    with interruptible() as stopped:
        assert not stopped()
        os.kill(os.getpid(), signal.SIGINT)
        assert stopped()
