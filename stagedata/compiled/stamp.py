"""What a kernel is made of: a digest of its code and of all that it reaches.

That is its bytecode, its options, the constants it uses and the kernels it calls, with theirs. A
comment, a docstring, another kernel in the same file or when the file was written make no
difference.
"""

from __future__ import annotations

import enum
import hashlib
from collections.abc import Iterator, Mapping
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np
from numba.core.dispatcher import Dispatcher
from numba.core.types import Type


def stamp(function: Any, options: Mapping[str, Any]) -> bytes:
    """Digest of a kernel, given as the Python function and numba's options."""
    return _Reach(function, options).digest()


class _Reach:
    """All that a kernel reaches, described in a fixed order."""

    def __init__(self, function: Any, options: Mapping[str, Any]) -> None:
        self._seen = {function}
        self._waiting = [(function, options)]
        self._digest = hashlib.sha256()

    def digest(self) -> bytes:
        """Of all of it."""
        while self._waiting:
            function, options = self._waiting.pop()
            self._add(f"{function.__module__}.{function.__qualname__}")
            self._add(self._value(tuple(options.items())))
            self._add(self._value(function.__defaults__))
            for cell in function.__closure__ or ():
                self._add(self._value(cell.cell_contents))
            self._add_code(function.__code__, function.__doc__, function.__globals__)
        return self._digest.digest()

    def _add(self, text: str | bytes) -> None:
        data = text.encode() if isinstance(text, str) else text
        self._digest.update(len(data).to_bytes(8, "little") + data)

    def _add_code(self, code: CodeType, doc: str | None, names: dict[str, Any]) -> None:
        self._add(code.co_code)
        self._add(repr((code.co_argcount, code.co_kwonlyargcount, code.co_flags)))
        self._add(repr((code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars)))
        for constant in code.co_consts:
            if isinstance(constant, CodeType):
                self._add_code(constant, None, names)
            elif doc is None or constant != doc:
                self._add(self._value(constant))
        for name in code.co_names:
            if name in names:
                self._add(f"{name} = {self._value(names[name], code.co_names)}")

    def _value(self, value: Any, names: tuple[str, ...] = ()) -> str:
        """What a kernel sees of a global, of whose attributes it uses some of `names`."""
        match value:
            case Dispatcher():
                for called in _called(value):
                    if called.py_func not in self._seen:
                        self._seen.add(called.py_func)
                        self._waiting.append((called.py_func, called.targetoptions))
                return f"kernel {value.__name__}"
            case None | bool() | int() | float() | complex() | str() | bytes() | Type():
                return repr(value)
            case tuple() | list():
                return f"{type(value).__name__}({', '.join(map(self._value, value))})"
            case set() | frozenset():
                return f"{{{', '.join(sorted(map(self._value, value)))}}}"
            case np.ndarray():
                held = hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()
                return f"{value.dtype} {value.shape} {held}"
            case np.generic() | np.dtype():
                return repr(value)
            case ModuleType():
                used = [name for name in names if name in vars(value)]
                inside = {name: self._attribute(vars(value)[name]) for name in used}
                return f"{value.__name__} {inside}"
            case type():
                return f"{value.__module__}.{value.__qualname__} {_shape(value)}"
            case FunctionType() | BuiltinFunctionType() | np.ufunc():
                return f"{getattr(value, '__module__', '')}.{value.__name__}"
        raise TypeError(f"{value!r}: a kernel uses it, and nothing tells when it changes")

    def _attribute(self, value: Any) -> str:
        try:
            return self._value(value)
        except TypeError:
            return type(value).__name__  # of the same name as an attribute of something else


def _called(dispatcher: Any) -> Iterator[Any]:
    """The kernels behind a name."""
    kernels = getattr(dispatcher, "kernels", None)
    if kernels is None:
        yield dispatcher
    else:
        yield from kernels().values()


def _shape(kind: type) -> str:
    """What a kernel sees of a class: a named tuple's fields, an enumeration's members."""
    if issubclass(kind, enum.Enum):
        return repr([(member.name, member.value) for member in kind])
    return repr(getattr(kind, "_fields", ()))
