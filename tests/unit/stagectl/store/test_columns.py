"""Columns of data files: preambles, separators, decimal commas, and what cannot be read."""

from pathlib import Path

import numpy as np
import pytest

from hil_sim.plant import simulate
from stagectl.config import stage_settings
from stagectl.config.import_map import load_map
from stagectl.errors import UnusableInput
from stagectl.store import import_recording

EXAMPLE = Path(__file__).parents[4] / "examples" / "emps"


@pytest.fixture
def example():
    return load_map(EXAMPLE / "map.yaml")


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


@pytest.mark.parametrize("delimiter", [",", ";", "\t", "  "])
def test_a_log_with_preamble_units_row_and_text(columns, tmp_path, delimiter):
    log = {**columns, "state": np.arange(3000)}
    path = csv_of(log, tmp_path / "a.txt", delimiter=delimiter)
    lines = path.read_text().splitlines()
    rows = [line.rsplit(delimiter, 1)[0] + delimiter + "moving" for line in lines[1:]]
    units = delimiter.join(["s", "m", "m", "V", "-"])
    path.write_text("\n".join(["Logger 3.1", "made: 2024-05-01, 10:00", lines[0], units, *rows]))
    slide = read(tmp_path, path, "time: {column: t}\n").axes["slide"]
    np.testing.assert_allclose(slide.position_demand, columns["qg"])
    with pytest.raises(UnusableInput, match="column state: 'moving' is not a number"):
        read(tmp_path, path, axis=AXIS.replace("vir", "state"))


def test_decimal_commas(columns, tmp_path):
    path = csv_of(columns, tmp_path / "a.csv", delimiter=";")
    path.write_text(path.read_text().replace(".", ","))
    slide = read(tmp_path, path).axes["slide"]
    np.testing.assert_allclose(slide.force_actual, columns["vir"])


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.mat", b"no such thing", "not a readable"),
        ("a.mat", b"\x89HDF\r\n\x1a\n" + bytes(600), "not a readable"),
        ("a.xyz", b"", "only .mat and .csv, .txt"),
        ("a.csv", b"", "empty"),
        ("a.csv", b"t,qg\n1,2\n3\n", "row 3: 1 values"),
        ("a.csv", b"t,qg\n1,x\n", "column qg: 'x' is not a number"),
        ("a.csv", b"\xff\xfe\x00", "not readable text"),
    ],
)
def test_unreadable_files_are_one_line(example, tmp_path, name, content, words):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(UnusableInput, match=words):
        import_recording(tmp_path / name, *example)
