"""Settings that cannot be are refused by name."""

import dataclasses
import math

import pytest

from drivers.errors import ConfigurationError
from drivers.settings import BusSettings, OptionCodes, RealTimeSettings


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


def bus(**settings):
    return BusSettings("virtual", "0", **settings)


@pytest.mark.parametrize(
    ("make", "changes", "text"),
    [
        *((bus, {"sync_period": p}, "sync_period") for p in (0.0, -1.0, math.inf, 1.5e-6, 1e-7)),
        *((bus, {"sync_counter": n}, "sync_counter: must be 0 or 2..240") for n in (1, -1, 241)),
        (bus, {"sync_source": "nobody"}, "sync_source"),
        (bus, {"sync_window": 2e-3}, "sync_window"),
        (bus, {"sync_window": 1e-6}, "sync_window"),
        (bus, {"max_late": -1}, "max_late"),
        (RealTimeSettings, {"priority": 100}, "realtime priority"),
        (RealTimeSettings, {"core": -1}, "realtime core"),
        (OptionCodes, {"quick_stop": 4}, "option code quick_stop: must be one of"),
        (OptionCodes, {"abort_connection": 0}, "option code abort_connection: must be one of"),
        (OptionCodes, {"halt": 0}, "option code halt: must be one of"),
        (OptionCodes, {"fault_reaction": 9}, "option code fault_reaction: must be one of"),
    ],
)
def test_impossible_settings_are_named(make, changes, text):
    with pytest.raises(ConfigurationError, match=text):
        make(**changes)


def test_the_period_is_exact():
    assert bus(sync_period=0.001).period_ns == 1_000_000
    assert bus(sync_period=0.0025).period_us == 2500
