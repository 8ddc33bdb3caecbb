"""Compiled kernels on disk that are older than the code they were made from.

numba keeps a function's machine code beside its file and makes it anew when that file changes, but
not when a function or constant that it took from another file does. So whenever any file of a
package with kernels, or of one that it takes functions from, is newer than a kept kernel, that
package's kept kernels are dropped.
"""

from __future__ import annotations

import math
from pathlib import Path

_ROOT = Path(__file__).resolve().parent.parent
_TAKES_FROM: dict[str, tuple[str, ...]] = {
    "estimation": (),
    "hil_sim": (),
    "sim2real": ("hil_sim",),
    "stagectl/paper": ("hil_sim",),
}
"""Of each folder with kernels, the folders whose code is compiled into them."""


def drop_stale() -> int:
    """Delete kept kernels that may be out of date; returns how many files went.

    Kernels that cannot be deleted (a read-only installation) are left: such files do not change.
    """
    dropped = 0
    for name, others in _TAKES_FROM.items():
        folder = _ROOT / name
        kept = [*folder.rglob("__pycache__/*.nbi"), *folder.rglob("__pycache__/*.nbc")]
        if not kept:
            continue
        sources = (p for n in (name, *others) for p in (_ROOT / n).rglob("*.py"))
        newest = max(path.stat().st_mtime for path in sources)
        if all(_time(path) >= newest for path in kept):
            continue
        for path in kept:
            try:
                path.unlink()
                dropped += 1
            except OSError:
                continue
    return dropped


def _time(path: Path) -> float:
    """When a kernel was kept; as if it were new where another process has just dropped it."""
    try:
        return path.stat().st_mtime
    except FileNotFoundError:
        return math.inf
