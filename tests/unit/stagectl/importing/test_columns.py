"""Columns of data files: what cannot be read, and times."""

import numpy as np
import pytest

from stagectl.errors import UnusableInput
from stagectl.importing import import_recording, load_map
from stagectl.importing.columns import read_plc_trace
from tests.unit.stagectl.logged_data import AXIS, EXAMPLE, csv_of, logged, read


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
    ("day", "how"),
    [("2024-05-01 ", ""), ("", ""), ("01.05.2024 ", ", format: '%d.%m.%Y %H:%M:%S.%f'")],
)
def test_dates_and_times_of_day(columns, tmp_path, day, how):
    at = ["clock", *(f"{day}23:59:{t:09.6f}" for t in columns["t"])]
    path = csv_of(columns, tmp_path / "a.csv")
    rows = path.read_text().splitlines()
    path.write_text("\n".join(f"{text},{row}" for text, row in zip(at, rows, strict=True)))
    found = read(tmp_path, path, f"time: {{column: clock{how}}}\n")
    np.testing.assert_allclose(found.time, columns["t"] - columns["t"][0], atol=1e-6)
    with pytest.raises(UnusableInput, match="is not a number"):
        read(tmp_path, path, axis=AXIS.replace("vir", "clock"))
    with pytest.raises(UnusableInput, match=r"column clock: time data .* does not match format"):
        read(tmp_path, path, "time: {column: clock, format: '%m/%d/%y %H:%M'}\n")


def test_a_counter_that_overflows_is_a_time(columns, tmp_path):
    count = (65000 + np.arange(3000)) % 65536
    counted = "time: {column: CYCLE, factor: 0.001, wrap: 65536}\n"
    found = logged(tmp_path, {**columns, "CYCLE": count}, counted)
    np.testing.assert_allclose(found.time, 0.001 * np.arange(3000), atol=1e-9)


HEAD = """<?xml version="1.0" encoding="utf-16"?>
<Trace><TraceConfiguration><Single Name="MicroSeconds" Type="bool">True</Single>
</TraceConfiguration><TraceData Version="1.0.0.0"><TraceRecord><TriggerState />
"""
TAIL = "</TraceRecord></TraceData></Trace>\n"


def variable(name, values, times):
    return (
        f'<TraceVariable VarName="{name}" VariableIndex="0" Type="System.Double">\n'
        f"<Values>{','.join(map(str, values))}</Values>\n"
        f"<Timestamps>{','.join(map(str, times))}</Timestamps></TraceVariable>\n"
    )


def written(path, *variables):
    path.write_text(HEAD + "".join(variables) + TAIL, encoding="utf-16")
    return path


def test_a_variable_of_another_task_has_its_own_times(columns, tmp_path):
    times = [round(1e6 * t) for t in columns["t"]]
    path = written(
        tmp_path / "axis.trace",
        *(variable(name, map(float, columns[name]), times) for name in ("qg", "qm")),
        variable("vir", map(float, columns["vir"][::2]), times[::2]),
        variable("bDone", ["False"] * 3000, times),
    )
    assert set(read_plc_trace(path)) == {"qg", "qm", "vir", "Timestamp", "vir.Timestamp"}
    head = (
        "time: {column: Timestamp, unit: us}\nresample: true\n"
        "files: {slow: {path: axis.trace, time: {column: vir.Timestamp, unit: us}}}\n"
    )
    axis = AXIS.replace("{column: vir}", "{column: vir, file: slow}")
    found = read(tmp_path, path, head, axis=axis).axes["slide"]
    np.testing.assert_allclose(found.force_actual[::2], columns["vir"][::2])
    np.testing.assert_allclose(found.position_actual, columns["qm"])


def test_values_without_times_are_one_line(tmp_path):
    path = written(tmp_path / "axis.trace", variable("qg", [1.0, 2.0], [0]))
    with pytest.raises(UnusableInput, match="qg: 2 values at 1 times"):
        read_plc_trace(path)
