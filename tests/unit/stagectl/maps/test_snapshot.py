"""Map and tracking of a run's beginning, kept in its recording to the last bit."""

import json

import numpy as np
import pytest

from stagectl.config.machine.file import load_machine
from stagectl.errors import UnusableInput
from stagectl.maps import load_active, restore_snapshot, take_snapshot
from tests.unit.stagectl.maps.conftest import BEGIN, GRID, STAGE, estimate, level


@pytest.fixture(scope="module")
def active(mapped, machine):
    return load_active(mapped.history, STAGE, machine, [GRID[7]], BEGIN + 6000)


def work(places):
    """What two moves at a site make of the tracking."""
    shown = []
    for k, place in enumerate((GRID[7], GRID[12])):
        expected = places.expected_at(place, 1.0 + k)
        shown += [value for e in expected for value in (e.coulomb, e.sigma)]
        answer = places.learn(0, "macro", estimate((1.03 * level("x", place), 0.02)), 1.5 + k)
        shown += [answer.coulomb, answer.sigma]
    return shown


def test_restored_from_json_it_goes_the_same_way_to_the_last_bit(active):
    note = json.loads(json.dumps(take_snapshot(active)))
    again = restore_snapshot(note, load_machine(), "recording.h5")
    assert again.version.number == active.version.number
    assert again.figures == active.figures
    assert again.drift == active.drift
    assert work(again.places) == work(active.places)


def test_it_is_of_the_beginning_whatever_the_run_learns_afterwards(active):
    before = take_snapshot(active)
    work(active.places)
    after = take_snapshot(active)
    assert before != after
    restored = restore_snapshot(before, load_machine(), "r")
    assert json.dumps(take_snapshot(restored)) == json.dumps(before)


def test_settings_of_another_version_are_ignored_and_damage_is_not(active):
    note = take_snapshot(active)
    for tracker in note["trackers"].values():
        tracker["settings"]["of_another_version"] = 1.0
    restore_snapshot(note, load_machine(), "r")
    with pytest.raises(UnusableInput, match=r"r: not a usable friction map"):
        restore_snapshot({**note, "content": "{}"}, load_machine(), "r")
    with pytest.raises(KeyError):
        restore_snapshot({k: v for k, v in note.items() if k != "sites"}, load_machine(), "r")
    spoilt = json.loads(json.dumps(note))
    numbers = spoilt["trackers"]["x"]
    packed = next(v for v in numbers.values() if isinstance(v, dict) and "float64" in v)
    packed["shape"] = [*packed["shape"], 2]
    with pytest.raises(ValueError, match=r"reshape|belong|fit"):
        restore_snapshot(spoilt, load_machine(), "r")
    assert np.isfinite(restore_snapshot(note, load_machine(), "r").places.origin)
