"""The decorator of all kernels, and one name for kernels that are chosen by type.

They are compiled for a level of the processor's family, not for this very machine. So kernels that
were compiled on one machine run on another, as those of a wheel do, and give the same results to
the last bit on all of them. Who sets NUMBA_CPU_NAME or NUMBA_CPU_FEATURES has chosen another.
"""

from __future__ import annotations

import gc
import os
import platform
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import llvmlite.binding as llvm
import numba
from numba.core import types
from numba.core.registry import CPUDispatcher

from stagedata.compiled.cache import KernelCache
from stagedata.compiled.libraries import EntryCompiler, InnerCompiler

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


choose_processor()

_OPTIONS = {
    "nopython": True,
    "boundscheck": None,
    "error_model": "numpy",
    "no_cfunc_wrapper": True,
}


def kernel(**options: Any) -> Callable[[Any], Any]:
    """Decorator: compiled on the first call, kept on disk, division as numpy's.

    Without the wrapper that only C code calls, of which each kernel would have one otherwise.

    Args:
        options: more options of numba's `njit`.
    """

    def wrap(function: Any) -> Any:
        if numba.config.DISABLE_JIT:
            return function
        return Kernel(function, {}, {**_OPTIONS, **options})

    return wrap


class Kernel(CPUDispatcher):
    """A compiled function: an entry point where Python calls it, code to link where a kernel does.

    Args:
        function: in Python, as `py_func` afterwards.
        types: of local variables, by name.
        options: of numba's `njit`.
    """

    def __init__(self, function: Any, types: dict[str, Any], options: dict[str, Any]) -> None:
        super().__init__(function, types, options, EntryCompiler)
        self._inner: _InnerKernel | None = None
        self._cache = KernelCache(function, options)

    def compile(self, sig: Any) -> Any:
        """Compile for these types or load what is kept of it; for numba."""
        with self._cache.claimed(), _without_collection():
            return super().compile(sig)

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """Of a call in another kernel; for numba, which would compile one for each literal."""
        if self._inner is None:
            options = {**self.targetoptions, "no_cpython_wrapper": True}
            self._inner = _InnerKernel(self.py_func, self.locals, options, InnerCompiler)
        return self._inner.get_call_template(tuple(map(types.unliteral, args)), kws)

    def get_overload(self, sig: Any) -> Any:
        """What is called there; for numba."""
        return self._inner.get_overload(sig) if self._inner else super().get_overload(sig)


def machine_code(kernel: Callable[..., Any], *arguments: Any) -> Callable[..., Any]:
    """What a call of the kernel runs in the end, compiled now for the types of these arguments.

    A call of a kernel looks at the type of every argument first, which costs more than a small
    kernel itself. The machine code does not: whoever calls it answers for the types, of arrays also
    the order in memory. Other ones are misread.

    Args:
        kernel: decorated by `kernel`.
        arguments: of the types to call it with; it is called with them once.
    """
    kernel(*arguments)
    if not isinstance(kernel, Kernel):  # not compiled at all
        return kernel
    types = tuple(kernel.typeof_pyval(argument) for argument in arguments)
    code: Callable[..., Any] = kernel.overloads[types].entry_point
    return code


class _InnerKernel(CPUDispatcher):
    """A kernel as other kernels call it."""

    def add_overload(self, compiled: Any) -> None:
        """Make it known to callers, under a key of its own: there is no function in memory."""
        compiled = compiled._replace(entry_point=object())
        self.targetctx.insert_user_function(
            compiled.entry_point, compiled.fndesc, [compiled.library]
        )
        self.overloads[tuple(compiled.signature.args)] = compiled


class KernelByType(CPUDispatcher):
    """One name for kernels that differ in the type of their first argument, a named tuple.

    Args:
        name: of all of them.
        kernels: gives them by that type.
    """

    def __init__(self, name: str, kernels: Callable[[], Mapping[type, Kernel]]) -> None:
        def call(first: Any, *others: Any) -> Any:
            return kernels()[type(first)](first, *others)

        call.__name__ = call.__qualname__ = name
        super().__init__(call, {}, _OPTIONS)
        self.kernels = kernels

    def __call__(self, *arguments: Any) -> Any:
        """From Python."""
        return self.py_func(*arguments)

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """Of a call in a kernel; for numba."""
        return self._chosen(args).get_call_template(args, kws)

    def get_overload(self, sig: Any) -> Any:
        """What is called there; for numba."""
        return self._chosen(sig).get_overload(sig)

    def _chosen(self, types: Any) -> Kernel:
        return self.kernels()[types[0].instance_class]


@contextmanager
def _without_collection() -> Iterator[None]:
    """No garbage collection: a compiler makes millions of objects and drops few of them."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()
