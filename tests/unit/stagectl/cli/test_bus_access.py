"""Ctrl-C while drives are moved by hand: once it unwinds, a second one does not disturb that."""

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
def test_the_second_does_not_break_off_what_the_first_began(number):
    with pytest.raises(click.exceptions.Abort) as ended:
        stop_twice(number)
    # one exception alone: the second raised none on the way out
    assert ended.value.__context__ is None or ended.value.__context__.__context__ is None
    os.kill(os.getpid(), number)  # the bus is being closed: this is not the moment either


def test_without_one_everything_is_as_before():
    before = signal.getsignal(signal.SIGINT)
    with interruptible() as asked:
        assert not asked()
    assert signal.getsignal(signal.SIGINT) is before


def test_one_that_is_waited_for_is_told_and_not_raised():
    with interruptible() as asked:
        assert not asked()
        os.kill(os.getpid(), signal.SIGINT)
        assert asked()
