"""The processor that kernels are compiled for: a level of its family, not this very machine.

So kernels that were compiled on one machine run on another, as those of a wheel do, and give the
same results to the last bit on all of them. Who sets NUMBA_CPU_NAME or NUMBA_CPU_FEATURES has
chosen another.
"""

from __future__ import annotations

import os
import platform
from collections.abc import Mapping

import llvmlite.binding as llvm
import numba

_LEVELS: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "x86_64": ("x86-64-v3", ("avx2", "fma", "bmi", "bmi2", "f16c", "lzcnt", "movbe")),
    "aarch64": ("generic", ()),
}
"""Family -> level, and what a processor must have for it. x86-64-v3 is of 2013: AVX2, fused
multiply-add; a processor without has kernels of its own."""


def level_of(family: str, features: Mapping[str, bool]) -> str | None:
    """The level that a processor can run, by LLVM's name; None where there is none for it.

    Args:
        family: as `platform.machine` names it.
        features: of the processor, by LLVM's names.
    """
    level, needs = _LEVELS.get(family, (None, ()))
    return level if all(features.get(name) for name in needs) else None


def choose_processor() -> None:
    """Have numba compile for it; before the first compilation of this process."""
    if "NUMBA_CPU_NAME" in os.environ or "NUMBA_CPU_FEATURES" in os.environ:
        return
    level = level_of(platform.machine(), llvm.get_host_cpu_features())
    if level is not None:
        os.environ["NUMBA_CPU_NAME"] = level
        os.environ["NUMBA_CPU_FEATURES"] = ""
        numba.config.reload_config()
