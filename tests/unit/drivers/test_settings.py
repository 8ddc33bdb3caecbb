"""Settings that cannot be are refused by name."""

import dataclasses

import pytest

from drivers.errors import ConfigurationError
from drivers.settings import BusSettings, RealTimeSettings


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
def test_impossible_axis_settings_are_named(axis_settings, change, text):
    with pytest.raises(ConfigurationError, match=f"^axis x: {text}"):
        dataclasses.replace(axis_settings[0], **change)


@pytest.mark.parametrize("period", [0.0, -1.0, float("inf"), 1.5e-6, 1e-7])
def test_impossible_periods_are_named(period):
    with pytest.raises(ConfigurationError, match="sync_period"):
        BusSettings("virtual", "0", sync_period=period)


def test_the_period_is_exact():
    assert BusSettings("virtual", "0", sync_period=0.001).period_ns == 1_000_000
    assert BusSettings("virtual", "0", sync_period=0.0025).period_us == 2500


@pytest.mark.parametrize(
    ("settings", "name"), [({"priority": 100}, "priority"), ({"core": -1}, "core")]
)
def test_impossible_real_time_settings_are_named(settings, name):
    with pytest.raises(ConfigurationError, match=f"realtime {name}"):
        RealTimeSettings(**settings)


@pytest.mark.parametrize(
    "settings",
    [{"sync_source": "nobody"}, {"sync_window": 2e-3}, {"max_late": -1}, {"sync_window": 1e-6}],
)
def test_impossible_bus_settings_are_named(settings):
    with pytest.raises(ConfigurationError, match=next(iter(settings))):
        BusSettings("virtual", "x", **settings)
