"""Plug-ins of other packages: made, or named where they are unusable."""

import sys

import pytest

from stagectl.errors import ConfigError
from stagectl.plug_ins import load_plug_in

MODULE = """
class Probe:
    pass

def broken():
    raise OSError("no probe on this\\nbus")
"""
ENTRIES = """[stagectl.temperature]
probe = lab_probe:Probe
broken = lab_probe:broken
absent = lab_probe_that_is_not_there:Probe
"""


@pytest.fixture(autouse=True)
def installed(tmp_path, monkeypatch):
    (tmp_path / "lab_probe.py").write_text(MODULE)
    info = tmp_path / "lab_probe-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: lab-probe\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(ENTRIES)
    monkeypatch.syspath_prepend(tmp_path)
    yield
    sys.modules.pop("lab_probe", None)


def test_a_plug_in_makes_its_object():
    assert type(load_plug_in("stagectl.temperature", "probe")).__name__ == "Probe"


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("nobody", "plug-in 'nobody' is not installed"),
        ("broken", "plug-in 'broken' cannot be loaded: OSError: no probe on this"),
        ("absent", "plug-in 'absent' cannot be loaded: ModuleNotFoundError"),
    ],
)
def test_an_unusable_plug_in_is_named_in_a_line(name, reason):
    with pytest.raises(ConfigError) as refused:
        load_plug_in("stagectl.temperature", name)
    assert str(refused.value).startswith(reason)
    assert "\n" not in str(refused.value)
