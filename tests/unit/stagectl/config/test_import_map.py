"""Import maps: units, factors, and whether they fit the machine."""

from pathlib import Path

import numpy as np
import pytest

from hil_sim.plant import simulate
from stagectl.config import stage_settings
from stagectl.config.import_map import load_map
from stagectl.errors import ConfigError
from stagectl.store import import_recording

EXAMPLE = Path(__file__).parents[4] / "examples" / "emps"


@pytest.fixture(scope="module")
def columns():
    """What the example's machine would have logged, in the data's own columns and units."""
    _, machine = load_map(EXAMPLE / "map.yaml")
    settings = stage_settings(machine)
    t = np.arange(3000) * 1e-3
    demand = (0.05 * np.sin(np.pi * t) ** 2)[:, None]
    response = simulate(settings, demand, np.zeros_like(demand), None)
    volts = response.force[:, 0] / 35.15065188248547
    return {
        "t": t, "qg": demand[:, 0], "qm": response.position[:, 0],
        "vir": np.concatenate((volts[1:], volts[-1:])),
    }  # fmt: skip


def csv_of(columns, path, header=True, delimiter=","):
    lines = [delimiter.join(columns)] if header else []
    lines += [
        delimiter.join(f"{v:.17g}" for v in row) for row in zip(*columns.values(), strict=True)
    ]
    path.write_text("\n".join(lines) + "\n")
    return path


MACHINE = (EXAMPLE / "machine.yaml").read_text()


AXIS = """  slide:
    position_demand: {column: qg}
    position_actual: {column: qm}
    force_actual: {column: vir}
"""


def read(tmp_path, path, head="", axis=AXIS, machine=MACHINE):
    """A file by a map with this head and these columns of the axis."""
    (tmp_path / "machine.yaml").write_text(machine)
    (tmp_path / "map.yaml").write_text(f"machine: machine.yaml\n{head}axes:\n{axis}")
    return import_recording(path, *load_map(tmp_path / "map.yaml"))


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
        ("machine.yaml", "missing.yaml", r"missing\.yaml"),
    ):
        (tmp_path / "map.yaml").write_text(text.replace(old, new))
        with pytest.raises(ConfigError, match=words):
            load_map(tmp_path / "map.yaml")
