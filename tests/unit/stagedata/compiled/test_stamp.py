"""A kernel's stamp changes with what the kernel computes, and with nothing else."""

import sys
from types import ModuleType

import pytest

from stagedata.compiled.kernels import Kernel
from stagedata.compiled.stamp import stamp

SOURCE = '''
"""A module."""
import enum
import math
from typing import NamedTuple

import numpy as np

from stagedata.compiled import KernelByType, kernel

GAIN = 2.0
TABLE = np.array([1.0, 2.0])
UNUSED = 5


class Side(enum.IntEnum):
    LEFT = 1


class Pair(NamedTuple):
    first: float
    second: float


@kernel()
def inner(x):
    """What others call."""
    return math.sin(x) * GAIN


@kernel(fastmath={"contract", "reassoc"})
def of_pair(pair):
    return inner(pair.first)


by_type = KernelByType("by_type", lambda: {Pair: of_pair})


@kernel()
def outer(x, times=3):
    """Doc."""
    total = by_type(Pair(x, 1.0)) + Side.LEFT  # a remark
    for k in range(times):
        if k in (1, 2):
            total += TABLE[k - 1]
    return total
'''


@pytest.fixture
def stamp_of(monkeypatch):
    """Stamp of a kernel of a module with this source."""

    def of(source=SOURCE, name="outer"):
        module = ModuleType("kernels_of_a_test")
        monkeypatch.setitem(sys.modules, module.__name__, module)
        exec(compile(source, "kernels_of_a_test.py", "exec"), vars(module))  # noqa: S102
        found = getattr(module, name)
        assert isinstance(found, Kernel)
        return stamp(found.py_func, found.targetoptions)

    return of


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ('"""Doc."""', '"""Another docstring."""'),
        ("  # a remark", ""),
        ("GAIN = 2.0", "\n\n\nGAIN = 2.0"),
        ("UNUSED = 5", "UNUSED = 6"),
        ('"""A module."""', "import json"),
    ],
)
def test_what_is_computed_stays_the_same(stamp_of, before, after):
    changed = SOURCE.replace(before, after)
    assert changed != SOURCE
    assert stamp_of(changed) == stamp_of()


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("range(times)", "range(1, times)"),
        ("(1, 2)", "(1, 3)"),
        ("times=3", "times=4"),
        ("GAIN = 2.0", "GAIN = 3.0"),
        ("math.sin(x)", "math.cos(x)"),
        ("[1.0, 2.0]", "[1.0, 2.5]"),
        ("second: float", "other: float"),
        ("LEFT = 1", "LEFT = 2"),
        ('{"contract", "reassoc"}', '{"contract"}'),
        ("{Pair: of_pair}", "{Pair: inner}"),
    ],
)
def test_what_is_computed_changes(stamp_of, before, after):
    changed = SOURCE.replace(before, after)
    assert changed != SOURCE
    assert stamp_of(changed) != stamp_of()


def test_a_kernel_does_not_depend_on_its_callers(stamp_of):
    changed = SOURCE.replace("range(times)", "range(1, times)")
    assert stamp_of(changed, "inner") == stamp_of(name="inner")


def test_what_cannot_be_judged_is_refused(stamp_of):
    changed = SOURCE.replace("GAIN = 2.0", "GAIN = object()")
    with pytest.raises(TypeError, match="nothing tells when it changes"):
        stamp_of(changed)
