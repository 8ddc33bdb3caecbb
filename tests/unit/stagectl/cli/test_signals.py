"""Signals that ask to stop: the first stops, further ones and ignored ones do nothing."""

import os
import signal

import click
import pytest

from stagectl.cli.signals import interruptible, on_stop, stop_on_signal
from tests.signals import STOPS, as_in_a_terminal


@pytest.fixture(autouse=True)
def handlers():
    with as_in_a_terminal():
        yield


def stop_twice(number):
    """One signal amid the motion, one amid the stop that it brings about."""
    with interruptible():
        try:
            os.kill(os.getpid(), number)
        finally:
            os.kill(os.getpid(), number)


@pytest.mark.parametrize("number", STOPS)
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


@pytest.mark.parametrize("number", STOPS)
def test_a_signal_that_is_ignored_at_the_start_stays_ignored(number):
    signal.signal(number, signal.SIG_IGN)
    stops = []
    stop_on_signal(stops.append)
    signal.raise_signal(number)
    assert stops == []
    with interruptible() as stopped:
        signal.raise_signal(number)
        assert not stopped()
    assert number not in on_stop(lambda *_: None)
    assert signal.getsignal(number) is signal.SIG_IGN


@pytest.mark.parametrize("number", STOPS)
def test_a_signal_that_is_heard_is_named(number):
    stops = []
    stop_on_signal(stops.append)
    signal.raise_signal(number)
    name = "Ctrl-C" if number is signal.SIGINT else number.name
    assert stops == [f"stopped by the operator ({name})"]
