"""Compiled kernels, and what optional parts of the program need."""

from __future__ import annotations

import os
from importlib.util import find_spec
from pathlib import Path

from stagectl.doctor.finding import Finding


def examine_kernels() -> Finding:
    """Where compiled kernels are, how many, and for which processor."""
    import llvmlite.binding as llvm

    from stagedata.compiled import SHIPPED, kernel_folder

    kernels = kernel_folder()
    folder, problem = kernels.path, kernels.problem()
    shipped = len(list(SHIPPED.glob("*.kernel")))
    kept = list(folder.glob("*.kernel")) if problem is None else []
    size = sum(path.stat().st_size for path in kept)
    processor = os.environ.get("NUMBA_CPU_NAME") or f"{llvm.get_host_cpu_name()}, this very one"
    writable = problem is None and _is_writable(folder)
    remedy = state = ""
    if problem is not None:
        state = f", refused: {problem}"
        remedy = "set NUMBA_CACHE_DIR to a folder of yours that nobody else can write"
    elif not writable:
        state = ", not writable"
        remedy = "set NUMBA_CACHE_DIR to a folder that can be written: else every run compiles"
    elif not shipped and not kept:
        remedy = "nothing: the first run compiles for some 20 s, once"
    return Finding(
        "kernels", writable,
        f"{shipped} came with the installation, {len(kept)} were compiled here "
        f"({size / 1e6:.1f} MB in {folder}{state}); for {processor}",
        remedy,
    )  # fmt: skip


def examine_postgres() -> Finding:
    """Whether a history can be in PostgreSQL: the client's library, and a server's programs."""
    servers = sorted(Path("/usr/lib/postgresql").glob("*/bin/initdb"))
    server = f"server {servers[-1].parts[4]} installed" if servers else "no server installed here"
    if find_spec("psycopg") is None:
        return Finding(
            "postgres", False, f"psycopg is missing; {server}", "pip install 'stagectl[postgres]'"
        )
    return Finding("postgres", True, f"psycopg is installed; {server}")


def _is_writable(folder: Path) -> bool:
    while not folder.exists():
        folder = folder.parent
    return folder.is_dir() and os.access(folder, os.W_OK)
