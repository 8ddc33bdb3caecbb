"""Temperature of a stage as last read; an object of a drive: tests/system/test_history.py."""

from stagectl.history import LatestTemperature
from stagectl.history.temperature import EVERY


def test_a_thermometer_is_read_at_most_once_a_minute():
    readings = iter([22.5, float("nan"), 23.0])
    latest = LatestTemperature(lambda: next(readings))
    assert [latest.at(t) for t in (0.0, EVERY - 1.0)] == [22.5, 22.5]
    assert latest.at(EVERY) is None  # no number is no reading
    assert latest.at(2.0 * EVERY) == 23.0
    assert latest.at(3.0 * EVERY) is None  # it fails: none, and nothing that stops a run
    assert LatestTemperature(None).at(0.0) is None
