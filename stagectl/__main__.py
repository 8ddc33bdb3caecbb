"""Entry point of `stagectl` and `python -m stagectl`; handles Ctrl-C outside the commands.

Commands handle Ctrl-C themselves. Before a command starts, during an import or a compilation, in a
finalizer and while the interpreter shuts down, a KeyboardInterrupt could end in a traceback, a
wrong exit code or an abort in C++, or get lost. There, Ctrl-C ends the process at once.
"""

from __future__ import annotations

import atexit
import gc
import os
import signal
import sys
from contextlib import suppress
from types import FrameType

_STOPPED = 130
BETWEEN_COLLECTIONS = 100_000
"""New objects between two garbage collections. At Python's 700, imports, which keep what they make,
would have all of it looked through hundreds of times: a tenth of a short command."""


def main() -> None:
    """Run the command line; for exit codes see `stagectl.cli`."""
    gc.set_threshold(BETWEEN_COLLECTIONS)
    # Read when numpy is first imported, here or in a child. What takes long has threads of its own;
    # more inside linear algebra would wait for each other at full load.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        # Registered first, so called last: after it, no handler of ours can run, and the signal's
        # default action would replace the exit code.
        atexit.register(signal.signal, signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGINT, _interrupt)
    # else Ctrl-C is ignored, as for a background job
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
    except SystemError as problem:  # raised by compiled kernels that an exception interrupts
        cause: BaseException | None = problem
        while isinstance(cause, SystemError):
            cause = cause.__cause__
        if not isinstance(cause, KeyboardInterrupt):
            raise
        _stop_at_once()
    sys.exit(code)


def _interrupt(number: int, frame: FrameType | None) -> None:
    """Ctrl-C during a command that has no handler of its own.

    An exception would get lost in a finalizer, which is often the first call after a kernel.
    """
    caller = frame
    while caller is not None:
        file, name = caller.f_code.co_filename, caller.f_code.co_name
        is_import = file == "<frozen importlib._bootstrap>"
        if is_import or name == "__del__" or f"{os.sep}llvmlite{os.sep}" in file:
            _stop_at_once()
        caller = caller.f_back
    signal.default_int_handler(number, frame)


def _shut_down(code: str | int | None) -> None:
    """From now on, Ctrl-C only cuts the shutdown short and keeps the exit code of a failure."""
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError, AttributeError):  # closed, broken pipe, or None
            stream.flush()
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        failed = code if isinstance(code, int) and code else _STOPPED
        signal.signal(signal.SIGINT, lambda *_: _stop_at_once(failed))


def _stop_at_once(code: int = _STOPPED) -> None:
    """End the process without an exception, which could get lost."""
    with suppress(OSError):
        os.write(2, b"stagectl: stopped\n")
    os._exit(code)


if __name__ == "__main__":
    main()
