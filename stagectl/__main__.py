"""The program: `stagectl` and `python -m stagectl`. Ctrl-C counts from its first line to its last.

A command deals with Ctrl-C itself. But before it, while the interpreter shuts down behind it, amid
an import or a compilation, an exception would end in a traceback, in another exit code, in C++ that
aborts, or would be lost: there Ctrl-C ends the process at once.
"""

from __future__ import annotations

import atexit
import os
import signal
import sys
from contextlib import suppress
from types import FrameType

_STOPPED = 130


def main() -> None:
    """Run the command line; exit codes as `stagectl.cli` says."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        # Registered first, so called last: behind it there is no place for a handler, and the
        # signal's own default would replace the exit code.
        atexit.register(signal.signal, signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGINT, _interrupt)
    # else Ctrl-C is ignored, as for a job in the background
    code: str | int | None = 0
    try:
        try:
            from stagectl.cli import main as run

            run()
        except SystemExit as ended:
            code = ended.code
        _shut_down(code)
    except KeyboardInterrupt:
        _stop_at_once()
    except SystemError as problem:  # what a compiled kernel makes of an exception in its midst
        cause: BaseException | None = problem
        while isinstance(cause, SystemError):
            cause = cause.__cause__
        if not isinstance(cause, KeyboardInterrupt):
            raise
        _stop_at_once()
    sys.exit(code)


def _interrupt(number: int, frame: FrameType | None) -> None:
    """Ctrl-C while a command runs that has no handler of its own."""
    caller = frame
    while caller is not None:
        file = caller.f_code.co_filename
        if file == "<frozen importlib._bootstrap>" or f"{os.sep}llvmlite{os.sep}" in file:
            _stop_at_once()
        caller = caller.f_back
    signal.default_int_handler(number, frame)


def _shut_down(code: str | int | None) -> None:
    """From here on Ctrl-C only cuts the shutdown short; a failure's exit code stays."""
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError, AttributeError):  # closed, a broken pipe, none at all
            stream.flush()
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        failed = code if isinstance(code, int) and code else _STOPPED
        signal.signal(signal.SIGINT, lambda *_: _stop_at_once(failed))


def _stop_at_once(code: int = _STOPPED) -> None:
    """End the process here: no exception that could get lost on its way."""
    with suppress(OSError):
        os.write(2, b"stagectl: stopped\n")
    os._exit(code)


if __name__ == "__main__":
    main()
