"""Compiled kernels on disk that are older than the code they were made from.

numba keeps a function's machine code beside its file and makes it anew when that file changes, but
not when a function or constant that it took from another file does. So whenever any file of a
package with kernels is newer than a kept kernel, that package's kept kernels are dropped.
"""

from __future__ import annotations

from pathlib import Path

_ROOT = Path(__file__).resolve().parent.parent
_FOLDERS = ("estimation", "hil_sim", "stagectl/paper")


def drop_stale() -> int:
    """Delete kept kernels that may be out of date; returns how many files went.

    Kernels that cannot be deleted (a read-only installation) are left: such files do not change.
    """
    dropped = 0
    for name in _FOLDERS:
        folder = _ROOT / name
        kept = [*folder.rglob("__pycache__/*.nbi"), *folder.rglob("__pycache__/*.nbc")]
        if not kept:
            continue
        newest = max(path.stat().st_mtime for path in folder.rglob("*.py"))
        if min(path.stat().st_mtime for path in kept) >= newest:
            continue
        for path in kept:
            try:
                path.unlink()
                dropped += 1
            except OSError:
                continue
    return dropped
