"""Tables and the page of a map."""

import csv
import re

import pytest

from stagectl.errors import UnusableInput
from stagectl.maps import MapVersion
from stagectl.maps.output.export import (
    Table,
    grid_table,
    refused_table,
    sites_table,
    trend_table,
    write_table,
)
from stagectl.maps.output.page import render_map
from tests.unit.stagectl.maps.conftest import GRID, calibrate, keep
from tests.unit.stagectl.rows import BEGIN, STAGE, estimate_record, run_entry


def test_sites_grid_estimates_and_page_hold_the_map(history, tmp_path):
    calibrate(history)
    number, built = keep(history, BEGIN)
    version = MapVersion(number, BEGIN, "a <comment>", True, built)
    sites = sites_table(version)
    assert len(sites.rows) == 50
    grid = grid_table(version, 0.01)
    inside = grid.columns.index("inside")
    assert {row[inside] for row in grid.rows} == {True, False}
    estimates = trend_table(history, STAGE)
    assert len(estimates.rows) == 208
    assert {row[estimates.columns.index("purpose")] for row in estimates.rows} == {"calibration"}
    assert refused_table(history, STAGE).rows == []
    number = history.start_run(run_entry(started=BEGIN + 900, lot="L7", wafer="W3"))
    jumps = {"accepted": False, "reason": "coulomb jumps by -16 %"}
    history.add([estimate_record(number, axis="y", place=GRID[0], **jumps)])
    refused = refused_table(history, STAGE)
    (row,) = (dict(zip(refused.columns, row, strict=True)) for row in refused.rows)
    assert (row["axis"], row["lot"], row["wafer"]) == ("y", "L7", "W3")
    assert row["reason"] == "coulomb jumps by -16 %"
    path = tmp_path / "sites.csv"
    write_table(sites, path)
    with path.open() as file:
        rows = list(csv.DictReader(file))
    assert float(rows[0]["coulomb_N"]) == built.axes["x"].sites[0].coulomb
    assert re.fullmatch(r"\S{10}T\S{8}\.\d{3}\+00:00", rows[0]["measured"])
    parquet = pytest.importorskip("pyarrow.parquet")
    write_table(estimates, tmp_path / "e.parquet")
    table = parquet.read_table(tmp_path / "e.parquet")
    assert table.num_rows == 208
    assert str(table.schema.field("time").type) == "timestamp[us, tz=UTC]"
    assert min(table["time"].to_pylist()).timestamp() == pytest.approx(BEGIN, abs=3600)
    with pytest.raises(UnusableInput, match=r"\.csv or \.parquet"):
        write_table(sites, tmp_path / "sites.xlsx")
    page = render_map(history, STAGE, version, version)
    assert page.count("<svg") == 2 * 3  # with the version before
    assert page.count('class="chart curves"') == 50
    assert "a &lt;comment&gt;" in page
    assert "those from a warm-up lie above the dashed line" in page
    assert not re.search(r"(src|href)=", page)


def test_a_name_is_no_formula_in_a_spreadsheet(tmp_path):
    path = tmp_path / "table.csv"
    names = ["=1+1", "+1", "-1", "@sum", "L7"]
    write_table(Table(("lot", "force"), [[name, -0.5] for name in names]), path)
    with path.open(newline="") as file:
        rows = list(csv.reader(file))[1:]
    assert [lot for lot, _ in rows] == ["'=1+1", "'+1", "'-1", "'@sum", "L7"]
    assert {force for _, force in rows} == {"-0.5"}
