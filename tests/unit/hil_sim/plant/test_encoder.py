"""The encoder: quantised, noisy, with a filtered velocity; the kernel's Python, uncompiled."""

import math
from types import SimpleNamespace

import pytest

from hil_sim.plant.encoder import read_encoder

PERIOD = 1e-4
read = read_encoder.py_func


def at_rest(position=0.0, **misreading):
    return SimpleNamespace(position=position, encoder=position, speed=0.0, **misreading)


def plant(noise=0.0, misreading=-1):
    return SimpleNamespace(increment=1e-9, noise=noise, misreading=misreading, on_load=False)


def test_readings_are_whole_increments_with_the_noise_inside():
    state = at_rest(12.4e-9)
    read(plant(), state, PERIOD, 3.0)
    assert state.encoder == pytest.approx(12e-9)
    read(plant(noise=2e-9), state, PERIOD, 3.0)
    assert state.encoder == pytest.approx(18e-9)


def test_the_velocity_follows_through_a_first_order_low_pass():
    state, speed = at_rest(), 0.1
    for k in range(1, 11):  # one time constant of 1 ms
        state.position = speed * k * PERIOD
        read(plant(), state, PERIOD, 0.0)
    assert state.speed == pytest.approx(speed * (1.0 - (1.0 / 1.1) ** 10), rel=1e-6)
    assert state.speed == pytest.approx(speed * (1.0 - math.exp(-1.0)), rel=0.03)
