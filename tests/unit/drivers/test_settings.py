"""Impossible settings are named."""

from __future__ import annotations

import dataclasses
from typing import Any

import pytest

from drivers.drive.axis import interpolation_period
from drivers.errors import ConfigurationError
from drivers.settings import AxisSettings, BusSettings


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"node": 127}, "node: must be 1..126, is 127"),
        ({"node": 0}, "node"),
        ({"rated_force": 0.0}, "rated_force: must be > 0"),
        ({"velocity": float("nan")}, "velocity: must be > 0, is nan"),
        ({"travel": (0.1, -0.1)}, "travel"),
        ({"travel": (-3.0, 3.0)}, "travel: does not fit INTEGER32"),
        ({"peak_force": 2000.0}, "peak_force"),
        ({"homing_velocity": (0.01, 0.0)}, "homing_velocity"),
    ],
)
def test_impossible_axis_settings_are_named(
    axis_settings: tuple[AxisSettings, ...], change: dict[str, Any], text: str
) -> None:
    with pytest.raises(ConfigurationError, match=f"^axis x: {text}"):
        dataclasses.replace(axis_settings[0], **change)


@pytest.mark.parametrize("period", [0.0, -1.0, float("inf"), 1.5e-6, 1e-7])
def test_impossible_periods_are_named(period: float) -> None:
    with pytest.raises(ConfigurationError, match="sync_period"):
        BusSettings("virtual", "0", sync_period=period)


def test_the_period_is_exact() -> None:
    assert BusSettings("virtual", "0", sync_period=0.001).period_ns == 1_000_000
    assert BusSettings("virtual", "0", sync_period=0.0025).period_us == 2500


@pytest.mark.parametrize("period_us", [1000, 2000, 2500, 250, 125, 4000, 10_000, 1_000_000])
def test_interpolation_period_is_the_sync_period(period_us: int) -> None:
    value, index = interpolation_period(period_us)
    assert 0 < value <= 255
    assert value * 10 ** (index + 6) == pytest.approx(period_us)


def test_a_period_without_interpolation_value_is_named() -> None:
    with pytest.raises(ConfigurationError, match=r"0x60C2:01 .*1234 us"):
        interpolation_period(1234)
