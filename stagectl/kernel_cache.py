"""Deletes cached numba kernels that may be older than their source code.

numba recompiles a cached function when its own file changes, but not when a function or constant
that it uses from another file does. Therefore all cached kernels of a package are deleted when any
file of it, or of a package whose functions it compiles in, is newer than one of them.
"""

from __future__ import annotations

import math
from pathlib import Path

_ROOT = Path(__file__).resolve().parent.parent
_COMPILES_IN: dict[str, tuple[str, ...]] = {
    "estimation": (),
    "hil_sim": (),
    "sim2real": ("hil_sim",),
    "stagectl/paper": ("hil_sim",),
}
"""Folder with kernels -> other folders whose code is compiled into them."""


def drop_stale() -> int:
    """Delete cached kernels that may be out of date; returns the number of deleted files.

    Kernels that cannot be deleted stay: the source of a read-only installation does not change.
    """
    dropped = 0
    for name, others in _COMPILES_IN.items():
        folder = _ROOT / name
        cached = [*folder.rglob("__pycache__/*.nbi"), *folder.rglob("__pycache__/*.nbc")]
        if not cached:
            continue
        sources = (p for n in (name, *others) for p in (_ROOT / n).rglob("*.py"))
        newest = max(path.stat().st_mtime for path in sources)
        if all(_time(path) >= newest for path in cached):
            continue
        for path in cached:
            try:
                path.unlink()
                dropped += 1
            except OSError:
                continue
    return dropped


def _time(path: Path) -> float:
    """When a kernel was cached; infinitely late if another process has just deleted it."""
    try:
        return path.stat().st_mtime
    except FileNotFoundError:
        return math.inf
