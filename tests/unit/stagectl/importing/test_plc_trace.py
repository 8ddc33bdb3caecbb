"""Columns of a CODESYS trace."""

import numpy as np
import pytest

from stagectl.errors import UnusableInput
from stagectl.importing.plc_trace import read_plc_trace
from tests.unit.stagectl.logged_data import AXIS, read

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


def test_a_trace_becomes_a_recording(columns, tmp_path):
    times = [round(1e6 * t) for t in columns["t"]]
    path = written(
        tmp_path / "axis.trace",
        *(variable(name, map(float, columns[name]), times) for name in ("qg", "qm", "vir")),
        variable("bDone", ["False"] * 3000, times),
    )
    found = read(tmp_path, path, "time: {column: Timestamp, unit: us}\n").axes["slide"]
    np.testing.assert_allclose(found.position_actual, columns["qm"])
    np.testing.assert_allclose(found.force_actual, columns["vir"])


def test_a_variable_of_another_task_has_its_own_times(columns, tmp_path):
    times = [round(1e6 * t) for t in columns["t"]]
    path = written(
        tmp_path / "axis.xml",
        variable("qg", map(float, columns["qg"]), times),
        variable("qm", map(float, columns["qm"]), times),
        variable("vir", map(float, columns["vir"][::2]), times[::2]),
    )
    assert set(read_plc_trace(path)) == {"qg", "qm", "vir", "Timestamp", "vir.Timestamp"}
    head = (
        "time: {column: Timestamp, unit: us}\nresample: true\n"
        "files: {slow: {path: axis.xml, time: {column: vir.Timestamp, unit: us}}}\n"
    )
    axis = AXIS.replace("{column: vir}", "{column: vir, file: slow}")
    found = read(tmp_path, path, head, axis=axis).axes["slide"]
    np.testing.assert_allclose(found.force_actual[::2], columns["vir"][::2])


def test_values_without_times_are_one_line(tmp_path):
    path = written(tmp_path / "axis.trace", variable("qg", [1.0, 2.0], [0]))
    with pytest.raises(UnusableInput, match="qg: 2 values at 1 times"):
        read_plc_trace(path)
