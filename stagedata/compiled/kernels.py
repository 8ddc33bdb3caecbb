"""The decorator of all kernels, and one name for kernels that are chosen by type."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numba
from numba.core import types
from numba.core.registry import CPUDispatcher

from stagedata.compiled.cache import KernelCache
from stagedata.compiled.libraries import EntryCompiler, InnerCompiler
from stagedata.compiled.target import choose_processor

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
