"""Tables in text files: preambles, separators, decimal commas, encodings."""

import numpy as np
import pytest

from stagectl.errors import UnusableInput
from stagectl.importing.text_table import read_table, to_number
from tests.unit.stagectl.logged_data import AXIS, csv_of, read


@pytest.fixture
def table_of(tmp_path):
    def read_text(text):
        (tmp_path / "table.csv").write_text(text)
        return read_table(tmp_path / "table.csv", None)

    return read_text


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


@pytest.mark.parametrize(("decimal", "group"), [(",", "."), (".", ",")])
def test_thousands_in_groups(columns, tmp_path, decimal, group):
    rows = [f"{1e6 * v:,.3f}" for v in columns["qg"]]
    marks = str.maketrans({".": decimal, ",": group})
    path = csv_of(columns, tmp_path / "a.csv", delimiter=";")
    lines = path.read_text().replace(".", decimal).splitlines()
    cells = [line + ";" + row.translate(marks) for line, row in zip(lines[1:], rows, strict=True)]
    path.write_text("\n".join([lines[0] + ";wide", *cells]))
    axis = AXIS.replace("{column: qg}", "{column: wide, unit: um}")
    slide = read(tmp_path, path, axis=axis).axes["slide"]
    np.testing.assert_allclose(slide.position_demand, columns["qg"], atol=1e-9)


def test_three_decimals_are_no_group_of_thousands(table_of):
    cells = ("1,234", "1.234.567,5", "1.5")
    assert [to_number(cell, ",") for cell in cells] == [1.234, 1234567.5, None]
    assert to_number("0,123") is None
    assert table_of("a;b\n12,345;1,250\n13,345;2,500\n").decimal == ","


def test_a_column_without_a_name_is_called_by_its_number(table_of):
    """As the index of a pandas table is written."""
    assert table_of(",t,q\n0,0.0,1.5\n1,0.1,2.5\n2,0.2,3.5\n").names == ["1", "t", "q"]


@pytest.mark.parametrize("end", ["EOF", "Sum;;12", "# 3 errors", "1.0;2", ";;;"])
def test_what_follows_the_numbers_is_left_out(table_of, end):
    found = table_of(f"t;q;note\n1.0;2.0;\n2.0;3.0;\n{end}\n")
    assert found.names == ["t", "q"]
    assert found.rows == [["1.0", "2.0"], ["2.0", "3.0"]]


def test_header_behind_a_comment_sign_and_delimiters_at_the_ends(columns, tmp_path):
    table = np.column_stack(list(columns.values()))
    path = tmp_path / "a.dat"
    np.savetxt(path, table, header=" ".join(columns))
    np.testing.assert_allclose(read(tmp_path, path).axes["slide"].force_actual, columns["vir"])
    path = csv_of(columns, tmp_path / "b.csv")
    path.write_text("".join(f"{line},\n" for line in path.read_text().splitlines()))
    np.testing.assert_allclose(read(tmp_path, path).axes["slide"].force_actual, columns["vir"])


@pytest.mark.parametrize("encoding", ["utf-16", "cp1252"])
def test_encodings_and_tabs_with_decimal_commas(columns, tmp_path, encoding):
    path = csv_of(columns, tmp_path / "a.txt", delimiter="\t")
    text = path.read_text().replace(".", ",")
    path.write_bytes(f"Prüfstand 20 °C\n{text}".encode(encoding))
    np.testing.assert_allclose(read(tmp_path, path).axes["slide"].force_actual, columns["vir"])


SCOPE = """\
Name\tYT Scope Project
File\tC:\\Scope\\axis.tcscopex
Starttime of export\t133238090039920000\tMonday, March 20, 2023\t19:03:23.992
Endtime of export\t133238090069910000\tMonday, March 20, 2023\t19:03:26.991

"""
CHANNEL = {
    "SymbolComment": "", "Data-Type": "REAL64", "SampleTime[ms]": "1", "SymbolBased": "True",
    "Port": "851", "Offset": "0", "BitMask": "0xFFFFFFFFFFFFFFFF",
}  # fmt: skip


@pytest.mark.parametrize("timelines", ["one", "each"])
def test_the_export_of_a_twincat_scope(columns, tmp_path, timelines):
    """Lines of its header have numbers, and each channel may have a column of times."""
    names = [name for name in columns if name != "t"]

    def line(first, cells):
        pairs = [(first, cell) for cell in cells]
        row = [first, *cells] if timelines == "one" else [part for pair in pairs for part in pair]
        return "\t".join(row) + "\n"

    text = SCOPE + line("Name", names)
    text += "".join(line(key, [value] * len(names)) for key, value in CHANNEL.items()) + "\n"
    for k in range(3000):
        text += line(str(k), [repr(float(columns[name][k])).replace(".", ",") for name in names])
    path = tmp_path / "scope.csv"
    path.write_text(text + "EOF\n")
    found = read(tmp_path, path, "time: {column: Name, unit: ms}\n").axes["slide"]
    np.testing.assert_allclose(found.force_actual, columns["vir"])
    np.testing.assert_allclose(found.position_actual, columns["qm"])


def test_a_bad_cell_of_the_first_row_is_named(columns, tmp_path):
    path = csv_of(columns, tmp_path / "a.csv")
    lines = path.read_text().splitlines()
    time, rest = lines[1].split(",", 1)
    lines[1] = f"{time},-,{rest.split(',', 1)[1]}"
    path.write_text("\n".join(lines))
    with pytest.raises(UnusableInput, match=r"row 2, column .*: '-' is not a number"):
        read(tmp_path, path)
