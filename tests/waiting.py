"""Waits for what another thread or process does."""

import time
from collections.abc import Callable

LONG = 300.0
"""No test waits for so long where all is well, however loaded the machine is [s]."""


def wait_until(reached: Callable[[], object]) -> None:
    """Return when it is true; a test that waits for ever fails instead."""
    ends = time.monotonic() + LONG
    while not reached():
        assert time.monotonic() < ends, "waited in vain"
        time.sleep(0.002)
