"""The processor that kernels are compiled for: a level of its family, not this very machine.

So kernels that were compiled on one machine run on another, as those of a wheel do, and give the
same results to the last bit on all of them. Who sets NUMBA_CPU_NAME or NUMBA_CPU_FEATURES has
chosen another.
"""

from __future__ import annotations

import os
import platform

import llvmlite.binding as llvm
import numba

_LEVEL = "x86-64-v3"
"""What x86-64 processors have had since 2013 (AVX2, fused multiply-add); of those without, each has
kernels of its own."""
_NEEDS = ("avx2", "fma", "bmi", "bmi2", "f16c", "lzcnt", "movbe")


def choose_processor() -> None:
    """Have numba compile for it; before the first compilation of this process."""
    if "NUMBA_CPU_NAME" in os.environ or "NUMBA_CPU_FEATURES" in os.environ:
        return
    if platform.machine() != "x86_64":
        return
    features = llvm.get_host_cpu_features()
    if all(features.get(name) for name in _NEEDS):
        os.environ["NUMBA_CPU_NAME"] = _LEVEL
        os.environ["NUMBA_CPU_FEATURES"] = ""
        numba.config.reload_config()
