"""Kernels called from Python, from other kernels, and from functions that numba compiles itself."""

import gc
import pickle
from typing import NamedTuple

import numba
import numpy as np
import pytest

from stagedata.compiled import KernelByType, kernel, machine_code


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
