"""Import maps: units, factors, and whether they fit the machine."""

import numpy as np
import pytest

from stagectl.errors import ConfigError
from stagectl.importing import load_map, unlike_rotary
from tests.unit.stagectl.logged_data import AXIS, EXAMPLE, MACHINE, logged

POSITIONS = (("rad", 1.0), ("deg", np.pi / 180), ("counts", 5e-8), ("rev", 2 * np.pi))
FORCES = (("N m", 1.0), ("'%'", 0.11), ("permille", 0.011), ("A, factor: 3.5", 3.5))


@pytest.mark.parametrize(
    ("channel", "unit", "size"),
    [
        *(("position_actual", unit, size) for unit, size in POSITIONS),
        *(("force_actual", unit, size) for unit, size in FORCES),
    ],
)
def test_units(columns, tmp_path, channel, unit, size):
    name = {"position_actual": "qm", "force_actual": "vir"}[channel]
    axis = AXIS.replace(f"{{column: {name}}}", f"{{column: {name}, unit: {unit}}}")
    slide = logged(tmp_path, columns, axis=axis).axes["slide"]
    np.testing.assert_allclose(getattr(slide, channel), columns[name] * size)


def test_amperes_need_their_factor(columns, tmp_path):
    axis = AXIS.replace("{column: vir}", "{column: vir, unit: A}")
    with pytest.raises(ConfigError, match="needs a factor: newtons"):
        logged(tmp_path, columns, axis=axis)


def test_a_map_must_fit_its_machine(tmp_path):
    (tmp_path / "machine.yaml").write_text(MACHINE)
    text = (EXAMPLE / "map.yaml").read_text()
    for old, new, words in (
        ("slide:", "sled:", "no axis sled"),
        ("{column: qm}", "{column: qm, unit: furlong}", "unknown unit 'furlong'"),
        ("{column: t}", "{column: t, unit: min}", "time.unit: unknown unit 'min'; known: s, ms"),
        ("machine.yaml", "missing.yaml", r"missing\.yaml"),
    ):
        (tmp_path / "map.yaml").write_text(text.replace(old, new))
        with pytest.raises(ConfigError, match=words):
            load_map(tmp_path / "map.yaml")


def test_units_of_a_rotary_axis_on_one_that_is_not(tmp_path):
    (tmp_path / "machine.yaml").write_text(MACHINE)
    for unit, found in (("deg", ["slide"]), ("mm", [])):
        axis = AXIS.replace("{column: qm}", f"{{column: qm, unit: {unit}}}")
        (tmp_path / "map.yaml").write_text(f"machine: machine.yaml\naxes:\n{axis}")
        assert unlike_rotary(*load_map(tmp_path / "map.yaml")) == found
    rotary = MACHINE.replace("    node: 1\n", "    node: 1\n    rotary: true\n")
    (tmp_path / "machine.yaml").write_text(rotary)
    (tmp_path / "map.yaml").write_text(f"machine: machine.yaml\naxes:\n{axis}".replace("mm", "deg"))
    assert unlike_rotary(*load_map(tmp_path / "map.yaml")) == []
