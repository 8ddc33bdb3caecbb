"""Columns of data files: preambles, separators, decimal commas, and what cannot be read."""

import numpy as np
import pytest

from stagectl.config.import_map import load_map
from stagectl.errors import UnusableInput
from stagectl.store import import_recording
from tests.unit.stagectl.logged_data import AXIS, EXAMPLE, csv_of, read


@pytest.fixture
def example():
    return load_map(EXAMPLE / "map.yaml")


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
