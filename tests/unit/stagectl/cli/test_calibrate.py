"""The closing table of a calibration in a terminal of usual width."""

import io
from types import SimpleNamespace

import pytest
from rich.console import Console

from stagectl.cli.calibrate import _table


@pytest.mark.parametrize("severity", ["good", "watch", "act", "failed"])
def test_the_table_fits_80_columns(severity):
    learnt = {"coulomb": SimpleNamespace(bits=116.9)}
    entry = SimpleNamespace(
        site=121, place=(-0.15, -0.15), axis="x", coulomb=12.021, sigma=0.105, change=-0.123,
        gains=learnt, severity=severity, suggestion="",
    )  # fmt: skip
    console = Console(width=80, record=True, file=io.StringIO())
    console.print(_table([entry], SimpleNamespace(gains={"x": learnt})))
    text = console.export_text()
    assert "…" not in text
    assert severity in text
