"""Kernels called from Python, by one another and by functions of numba's; their processor."""

import gc
import json
import os
import pickle
import platform
import subprocess
import sys
from typing import NamedTuple

import llvmlite.binding as llvm
import numba
import numpy as np
import pytest

from stagedata.compiled import KernelByType, kernel, machine_code
from stagedata.compiled.kernels import level_of


class Square(NamedTuple):
    side: float


class Circle(NamedTuple):
    radius: float


@kernel()
def area_of_square(square):
    return square.side**2


@kernel()
def area_of_circle(circle):
    return np.pi * circle.radius**2


area = KernelByType("area", lambda: {Square: area_of_square, Circle: area_of_circle})


@kernel()
def both(square, circle):
    return area(square) + area(circle)


@kernel()
def reciprocal(x):
    return 1.0 / x


@kernel(error_model="python")
def checked_reciprocal(x):
    return 1.0 / x


@kernel()
def refused(x):
    if x < 0.0:
        raise ValueError("negative")
    return reciprocal(x)


def test_a_name_for_several_kernels_goes_by_the_type():
    assert area(Square(3.0)) == 9.0
    assert both(Square(3.0), Circle(1.0)) == pytest.approx(9.0 + np.pi)


def test_division_is_numpys_unless_asked_otherwise():
    assert reciprocal(0.0) == np.inf
    with pytest.raises(ZeroDivisionError):
        checked_reciprocal(0.0)


def test_an_exception_reaches_the_caller():
    assert refused(2.0) == 0.5
    with pytest.raises(ValueError, match="negative"):
        refused(-1.0)


def test_a_function_that_numba_compiles_can_call_kernels():
    @numba.njit
    def call(square, circle):
        return both(square, circle) + refused(4.0)

    assert call(Square(1.0), Circle(0.0)) == 1.25


def test_a_kernel_can_be_sent_to_another_process():
    assert pickle.loads(pickle.dumps(refused))(4.0) == 0.25  # noqa: S301


def test_collection_goes_on_after_compiling():
    @kernel()
    def doubled(x):
        return 2 * x

    assert doubled(1) == 2
    assert gc.isenabled()


def test_the_machine_code_of_a_kernel_computes_what_the_kernel_does():
    call = machine_code(both, Square(3.0), Circle(1.0))
    assert call(Square(2.0), Circle(3.0)) == both(Square(2.0), Circle(3.0))
    with pytest.raises(ValueError, match="negative"):
        machine_code(refused, 1.0)(-1.0)


# The processor --------------------------------------------------------------------------------

SHOW = (
    "import json, os, stagedata.compiled.kernels;"
    "import numba; print(json.dumps([numba.config.CPU_NAME, numba.config.CPU_FEATURES]))"
)


def chosen(**environment):
    clean = {k: v for k, v in os.environ.items() if not k.startswith("NUMBA_CPU")}
    done = subprocess.run(
        [sys.executable, "-c", SHOW], env=clean | environment, capture_output=True, text=True,
        check=True,
    )  # fmt: skip
    return json.loads(done.stdout)  # type: ignore[no-any-return]


def test_this_process_compiles_for_the_level_of_its_processor():
    level = level_of(platform.machine(), llvm.get_host_cpu_features())
    assert chosen() == [level, None if level is None else ""]


V3 = dict.fromkeys(("avx2", "fma", "bmi", "bmi2", "f16c", "lzcnt", "movbe"), True)


@pytest.mark.parametrize(
    ("family", "features", "level"),
    [
        ("x86_64", V3, "x86-64-v3"),
        ("x86_64", V3 | {"avx512f": True, "amx-tile": True}, "x86-64-v3"),  # not more than that
        ("x86_64", V3 | {"movbe": False}, None),
        ("x86_64", {}, None),
        ("aarch64", {"sve": True}, "generic"),
        ("riscv64", {}, None),
    ],
)
def test_the_level_is_one_that_the_processor_can_run(family, features, level):
    assert level_of(family, features) == level


def test_what_the_user_has_chosen_stays():
    assert chosen(NUMBA_CPU_NAME="generic")[0] == "generic"
    assert chosen(NUMBA_CPU_FEATURES="+sse4.2")[1] == "+sse4.2"
