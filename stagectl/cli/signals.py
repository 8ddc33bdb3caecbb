"""Signals that ask a command to stop: Ctrl-C, SIGTERM, a lost terminal."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import click

Handler = Callable[[int, Any], None]


def on_stop(handler: Handler) -> dict[int, Any]:
    """From now on, a signal that asks to stop calls `handler`.

    A signal that is ignored stays so: the caller said so at the start, as nohup does of SIGHUP and
    a script's `&` of SIGINT.

    Returns:
        Signal number -> handler before, of those signals that had one.
    """
    heard = [
        number
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
        if signal.getsignal(number) is not signal.SIG_IGN
    ]
    return {number: signal.signal(number, handler) for number in heard}


def stop_on_signal(stop: Callable[[str], None]) -> None:
    """From now on, Ctrl-C, SIGTERM and a lost terminal request a controlled stop, with a reason."""

    def handler(number: int, _: Any) -> None:
        name = "Ctrl-C" if number == signal.SIGINT else signal.Signals(number).name
        stop(f"stopped by the operator ({name})")

    on_stop(handler)


@contextmanager
def interruptible() -> Iterator[Callable[[], bool]]:
    """Turn the first Ctrl-C into an orderly end, and ignore further ones while drives are stopped.

    Yields:
        A function that returns whether Ctrl-C was pressed. From its first call on, Ctrl-C only
        sets that flag; before, it interrupts what is under way.
    """
    pressed = polled = False

    def stopped() -> bool:
        nonlocal polled
        polled = True
        return pressed

    def handler(number: int, _: Any) -> None:
        nonlocal pressed
        if pressed:
            return
        pressed = True
        if not polled:
            raise KeyboardInterrupt

    before = on_stop(handler)
    try:
        yield stopped
    except KeyboardInterrupt:
        raise click.exceptions.Abort from None
    finally:
        if not pressed:
            for number, former in before.items():
                signal.signal(number, former)
