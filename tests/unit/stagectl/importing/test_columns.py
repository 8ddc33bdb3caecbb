"""Columns of data files: what cannot be read, and times."""

import numpy as np
import pytest

from stagectl.errors import UnusableInput
from stagectl.importing import import_recording, load_map
from tests.unit.stagectl.logged_data import AXIS, EXAMPLE, csv_of, read


@pytest.fixture
def example():
    return load_map(EXAMPLE / "map.yaml")


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.mat", b"no such thing", "not a readable"),
        ("a.mat", b"\x89HDF\r\n\x1a\n" + bytes(600), "not a readable"),
        ("a.xlsx", b"PK\x03\x04\xff\x00", r"not readable text; export it as \.csv"),
        ("a.npz", b"PK\x03\x04no archive", "not a readable .npz"),
        ("a.npz", b"no archive", "not a readable .npz"),
        ("a.h5", b"\x89HDF\r\n\x1a\n" + bytes(600), "not a readable .h5 file"),
        ("a.trace", b"<Trace>", "not a readable trace"),
        ("a.xml", b"<Trace/>", "no TraceVariable with samples of numbers"),
        ("a.csv", b"", "empty"),
        ("a.csv", b"t,qg\n1,2\n3\n4,5\n", "row 3: 1 values"),
        ("a.csv", b"t,qg\n1,x\n", "column qg: 'x' is not a number"),
        ("a.csv", b"\xff\xfe\x00", "not readable text"),
    ],
)
def test_unreadable_files_are_one_line(example, tmp_path, name, content, words):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(UnusableInput, match=words):
        import_recording(tmp_path / name, *example)


@pytest.mark.parametrize(
    ("form", "how"),
    [
        ("2024-05-01 23:59:{:09.6f}", ""),
        ("23:59:{:09.6f}", ""),
        ("01.05.2024 23:59:{:09.6f}", ", format: '%d.%m.%Y %H:%M:%S.%f'"),
    ],
)
def test_dates_and_times_of_day(columns, tmp_path, form, how):
    at = [form.format(t) for t in columns["t"]]
    path = csv_of(columns, tmp_path / "a.csv")
    head, *rows = path.read_text().splitlines()
    lines = [f"{text},{row}" for text, row in zip(at, rows, strict=True)]
    path.write_text("\n".join([f"clock,{head}", *lines]))
    found = read(tmp_path, path, f"time: {{column: clock{how}}}\n")
    np.testing.assert_allclose(found.time, columns["t"] - columns["t"][0], atol=1e-6)
    with pytest.raises(UnusableInput, match="is not a number"):
        read(tmp_path, path, axis=AXIS.replace("vir", "clock"))
    with pytest.raises(UnusableInput, match=r"column clock: time data .* does not match format"):
        read(tmp_path, path, "time: {column: clock, format: '%m/%d/%y %H:%M'}\n")


def test_a_counter_that_overflows_is_a_time(columns, tmp_path):
    count = (65000 + np.arange(3000)) % 65536
    path = csv_of({**columns, "CYCLE": count}, tmp_path / "a.csv")
    found = read(tmp_path, path, "time: {column: CYCLE, factor: 0.001, wrap: 65536}\n")
    np.testing.assert_allclose(found.time, 0.001 * np.arange(3000), atol=1e-9)
