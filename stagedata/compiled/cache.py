"""Where compiled kernels are kept: one file for each kernel and the types it is called with.

A file is named after all that it depends on: the kernel's code (`stamp`), the types, the processor,
the versions of Python and numba. So a file is never out of date, and only one that is missing is
compiled. It is looked for among those that came with the installation, then in the folder for new
ones (`folder`).

Of several processes that miss a file, one compiles and the others wait for it.
"""

from __future__ import annotations

import hashlib
import pickle
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any, BinaryIO

import llvmlite
import llvmlite.binding as llvm
import numba
from numba.core import types
from numba.core.caching import _Cache
from numba.core.compiler import CompileResult
from numba.core.runtime import rtsys
from numba.core.serialize import dumps
from numba.core.sigutils import normalize_signature

from stagedata.compiled.folder import kernel_folder, whole
from stagedata.compiled.stamp import stamp

SHIPPED = Path(__file__).parent / "shipped"
"""Kernels that came with the installation; whoever can write them can write the program, too."""
KEPT = 4
"""So many versions of a kernel, those used last, for who goes back and forth between them."""

_listeners: list[Callable[[str], object]] = []
"""See `on_compiling`."""


@contextmanager
def on_compiling(listener: Callable[[str], object]) -> Iterator[None]:
    """Within it, `listener` is called with a kernel's name before it is compiled.

    Also before another process that compiles it is waited for.
    """
    _listeners.append(listener)
    try:
        yield
    finally:
        _listeners.remove(listener)


_users: list[Callable[[Path], object]] = []
"""See `on_use`."""


@contextmanager
def on_use(listener: Callable[[Path], object]) -> Iterator[None]:
    """Within it, `listener` is called with the file of each kernel that is loaded or kept."""
    _users.append(listener)
    try:
        yield
    finally:
        _users.remove(listener)


class KernelCache(_Cache):
    """Of one kernel, as numba asks for it.

    Args:
        function: the kernel in Python.
        options: numba's for it.
    """

    def __init__(self, function: Any, options: Mapping[str, Any]) -> None:
        self._function = function
        self._options = options
        self._claim: BinaryIO | None = None

    @property
    def cache_path(self) -> str:
        """The folder for new files."""
        return str(kernel_folder().path)

    def enable(self) -> None:
        """Nothing: kernels are always kept."""

    def disable(self) -> None:
        """Nothing, likewise; numba's interface has it and numba does not call it."""

    def flush(self) -> None:
        """Forget all that is kept of this kernel."""
        kernel_folder().drop(self._name)

    @property
    def _name(self) -> str:
        return f"{self._function.__module__}.{self._function.__qualname__}"

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The kernel for these types; None if it is not kept, and this process is to compile it."""
        name = self._file(sig, target_context.codegen())
        if (found := _read_shipped(name)) is not None:
            _tell_users(SHIPPED / name)
            return _rebuild(found, target_context)
        found = kernel_folder().read(name)
        if found is None:
            for listener in _listeners:
                listener(self._name)
            self._claim = kernel_folder().lock(f"{self._name}.lock")
            found = kernel_folder().read(name)  # by now, if another process compiled it
        if found is None:
            return None
        _tell_users(kernel_folder().path / name)
        return _rebuild(found, target_context)

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep the kernel; without room or permission it is compiled again next time."""
        name = self._file(sig, data.codegen)
        with suppress(OSError):
            kernel_folder().write(name, _reduce(data))
            _tell_users(kernel_folder().path / name)
            kernel_folder().drop(name.rpartition("-")[0], KEPT)

    @contextmanager
    def claimed(self) -> Iterator[None]:
        """Within it this process may be the one that compiles."""
        try:
            yield
        finally:
            claim, self._claim = self._claim, None
            if claim is not None:
                claim.close()

    def _file(self, sig: Any, codegen: Any) -> str:
        """Name of the file: kernel, types and processor, code."""
        args, _ = normalize_signature(sig)
        called = f"{[_describe(kind) for kind in args]} {codegen.magic_tuple()} {_made_by()}"
        short = hashlib.sha256(called.encode()).hexdigest()[:16]
        return f"{self._name}-{short}-{stamp(self._function, self._options).hex()[:32]}.kernel"


@cache
def _made_by() -> str:
    """What compiles: other versions or other rules give other code."""
    rules = (Path(__file__).parent / "libraries.py").read_bytes()
    return repr(
        (sys.implementation.cache_tag, numba.__version__, llvmlite.__version__,
         numba.config.OPT, hashlib.sha256(rules).hexdigest())
    )  # fmt: skip


def _describe(kind: Any) -> str:
    """A numba type in full: the name of a named tuple's type leaves out which one it is."""
    if isinstance(kind, types.BaseTuple):
        named = getattr(kind, "instance_class", tuple)
        return f"{named.__module__}.{named.__qualname__}({', '.join(map(_describe, kind))})"
    return str(kind)


def _reduce(compiled: Any) -> bytes:
    """A compiled kernel as bytes, with the names of the functions that it calls in memory."""
    module = compiled.library._final_module
    outside = tuple(
        fn.name for fn in module.functions
        if fn.is_declaration and not fn.name.startswith("llvm.")
    )  # fmt: skip
    data: bytes = dumps((outside, compiled._reduce()))
    return data


def _rebuild(data: bytes, target_context: Any) -> Any:
    """The compiled kernel, ready to be called.

    numba loads all that it can compile with before it loads a kernel. Its runtime is enough, unless
    the kernel calls a function that comes with the rest.
    """
    outside, reduced = pickle.loads(data)  # noqa: S301  (written by this program, in a folder that only this user writes)
    rtsys.initialize(target_context)
    if not all(llvm.address_of_symbol(name) for name in outside):
        target_context.refresh()
    return CompileResult._rebuild(target_context, *reduced)


def _tell_users(path: Path) -> None:
    for listener in _users:
        listener(path)


def _read_shipped(name: str) -> bytes | None:
    """A kernel that came with the installation; None if there is none."""
    try:
        return whole((SHIPPED / name).read_bytes())
    except OSError:
        return None
