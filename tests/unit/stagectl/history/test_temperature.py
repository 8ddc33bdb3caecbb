"""Temperature of a stage out of a plug-in; an object of a drive: tests/system/test_history.py."""

import sys

import pytest

from stagectl.errors import ConfigError
from stagectl.history import LatestTemperature
from stagectl.history.temperature import EVERY, load_plugin

MODULE = """
class Probe:
    readings = iter([22.5, float("nan"), 23.0])
    def read(self):
        return next(self.readings)

def broken():
    raise OSError("no probe on this\\nbus")
"""
ENTRIES = """[stagectl.temperature]
probe = lab_probe:Probe
broken = lab_probe:broken
absent = lab_probe_that_is_not_there:Probe
"""


@pytest.fixture
def installed(tmp_path, monkeypatch):
    (tmp_path / "lab_probe.py").write_text(MODULE)
    info = tmp_path / "lab_probe-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: lab-probe\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(ENTRIES)
    monkeypatch.syspath_prepend(tmp_path)
    yield
    sys.modules.pop("lab_probe", None)


def test_a_plugin_is_read_at_most_once_a_minute(installed):
    latest = LatestTemperature(load_plugin("probe"))
    assert [latest.at(t) for t in (0.0, EVERY - 1.0)] == [22.5, 22.5]
    assert latest.at(EVERY) is None  # no number is no reading
    assert latest.at(2.0 * EVERY) == 23.0
    assert latest.at(3.0 * EVERY) is None  # it fails: none, and nothing that stops a run
    assert LatestTemperature(None).at(0.0) is None


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("nobody", "'nobody' is not installed"),
        ("broken", "'broken' cannot be loaded: OSError: no probe on this"),
        ("absent", "'absent' cannot be loaded: ModuleNotFoundError"),
    ],
)
def test_an_unusable_plugin_is_named(installed, name, reason):
    with pytest.raises(ConfigError) as refused:
        load_plugin(name)
    assert reason in str(refused.value)
    assert "\n" not in str(refused.value)
