"""Compiling what a run needs, once, in two processes.

Most of the time goes into the estimator's kernels, one after the other in one process. As soon as
one is missing, a second process compiles what the run needs after them, so that it finds it.
"""

from __future__ import annotations

import pickle
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from stagectl.config.machine import Machine
from stagedata.compiled import on_compiling


@contextmanager
def compiled_by_two(
    machine: Machine, truth: Machine | None, announce: Callable[[str], object]
) -> Iterator[None]:
    """Within it, a missing kernel is announced, and the first one starts the second process.

    Args:
        machine: the host's.
        truth: of the virtual stage, if there is one.
        announce: called with a few words before each kernel that is compiled.
    """
    second: list[subprocess.Popen[bytes]] = []

    def start(_kernel: str) -> None:
        announce("compiling, once")
        if not second:
            with suppress(OSError):  # then all of it is compiled here
                second.append(_start_second(machine, truth))

    try:
        with on_compiling(start):
            yield
    finally:
        for process in second:
            process.terminate()
            process.wait()


def _start_second(machine: Machine, truth: Machine | None) -> subprocess.Popen[bytes]:
    with tempfile.TemporaryFile() as machines:
        pickle.dump((machine, truth), machines)
        machines.seek(0)
        return subprocess.Popen(  # noqa: S603
            [sys.executable, "-P", "-m", __name__],
            stdin=machines, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip


def _compile(machine: Machine, truth: Machine | None) -> None:
    """Compile the host's observer, the plant of the virtual stage, the feedforward."""
    from stagectl.config.settings.observer import compile_observer
    from stagectl.sequencer.compensation import compile_kernels

    compile_observer(machine)
    if truth is not None:
        from hil_sim.plant import warm_up
        from stagectl.config.settings.package_settings import stage_settings

        warm_up(stage_settings(truth))
    compile_kernels(machine, estimator=False)


if __name__ == "__main__":
    _compile(*pickle.load(sys.stdin.buffer))  # noqa: S301  (written by the process that started it)
