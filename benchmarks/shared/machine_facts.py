"""Where a figure was measured: one line for the head of every benchmark's output."""

from __future__ import annotations

import os
import platform


def machine_facts() -> str:
    """Cores that this process may use, architecture, Python."""
    cores = len(os.sched_getaffinity(0))
    return (
        f"{cores} {platform.machine()} cores, "
        f"{platform.python_implementation()} {platform.python_version()}"
    )
