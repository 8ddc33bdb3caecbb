"""Import maps: units, factors, and whether they fit the machine."""

import numpy as np
import pytest

from stagectl.errors import ConfigError
from stagectl.importing import load_map, unlike_rotary
from tests.unit.stagectl.logged_data import AXIS, EXAMPLE, MACHINE, csv_of, read


@pytest.mark.parametrize(
    ("unit", "size"),
    [("rad", 1.0), ("deg", np.pi / 180), ("counts", 5e-8), ("rev", 2 * np.pi)],
)
def test_units_of_positions(columns, tmp_path, unit, size):
    axis = AXIS.replace("{column: qm}", f"{{column: qm, unit: {unit}}}")
    slide = read(tmp_path, csv_of(columns, tmp_path / "a.csv"), axis=axis).axes["slide"]
    np.testing.assert_allclose(slide.position_actual, columns["qm"] * size)


@pytest.mark.parametrize(
    ("unit", "size"),
    [("N m", 1.0), ("'%'", 0.11), ("permille", 0.011), ("A, factor: 3.5", 3.5)],
)
def test_units_of_forces(columns, tmp_path, unit, size):
    axis = AXIS.replace("{column: vir}", f"{{column: vir, unit: {unit}}}")
    slide = read(tmp_path, csv_of(columns, tmp_path / "a.csv"), axis=axis).axes["slide"]
    np.testing.assert_allclose(slide.force_actual, columns["vir"] * size)


def test_amperes_need_their_factor(columns, tmp_path):
    axis = AXIS.replace("{column: vir}", "{column: vir, unit: A}")
    with pytest.raises(ConfigError, match="needs a factor: newtons"):
        read(tmp_path, csv_of(columns, tmp_path / "a.csv"), axis=axis)


def test_a_map_must_fit_its_machine(tmp_path):
    (tmp_path / "machine.yaml").write_text((EXAMPLE / "machine.yaml").read_text())
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
    node = "    node: 1\n"
    assert node in MACHINE
    (tmp_path / "machine.yaml").write_text(MACHINE.replace(node, f"{node}    rotary: true\n"))
    (tmp_path / "map.yaml").write_text(f"machine: machine.yaml\naxes:\n{axis}".replace("mm", "deg"))
    assert unlike_rotary(*load_map(tmp_path / "map.yaml")) == []
