"""Signals that ask a process to stop, whatever this suite was started with.

A script's `&` hands down a SIGINT that is ignored, nohup a SIGHUP.
"""

import signal
from collections.abc import Iterator
from contextlib import contextmanager

STOPS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def listening() -> None:
    """A child's `preexec_fn`: it gets the signals as a shell in a terminal hands them down."""
    for number in STOPS:
        signal.signal(number, signal.SIG_DFL)


@contextmanager
def as_in_a_terminal() -> Iterator[None]:
    """Within it, this process handles these signals as Python does in a terminal."""
    before = {number: signal.getsignal(number) for number in STOPS}
    try:
        listening()
        signal.signal(signal.SIGINT, signal.default_int_handler)
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
