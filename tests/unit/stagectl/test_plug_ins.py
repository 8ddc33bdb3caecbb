"""Plug-ins of other packages: made, or named where they are unusable."""

import pytest

from stagectl.errors import ConfigError
from stagectl.plug_ins import load_plug_in

MODULE = """
class Probe:
    pass

def broken():
    raise OSError("no probe on this\\nbus")
"""


@pytest.fixture(autouse=True)
def installed(install):
    of = {
        "probe": "lab_probe:Probe",
        "broken": "lab_probe:broken",
        "absent": "no_such_module:Probe",
    }
    install("lab_probe", MODULE, "stagectl.temperature", **of)


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
