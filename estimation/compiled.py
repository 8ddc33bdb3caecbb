"""How the kernels of this package are compiled."""

from __future__ import annotations

from functools import partial

import numba

kernel = partial(numba.njit, cache=True, error_model="numpy", no_cfunc_wrapper=True)
"""Decorator: kept on disk, division as numpy's, and without the wrapper that only C code calls, of
which each kernel has one otherwise, and which takes a twentieth of the time of compiling."""
