"""The report's JSON: plain, and null where a figure is not known."""

import json
import math

import pytest

from sim2real.findings import Cause, GapFigures, GapReport, Parameter, Where, finding_json, schema
from tools.schemas import FOLDER, SCHEMAS


def test_figures_that_are_not_finite_are_null():
    cause = Cause("x", "cogging", 0.9, {"pitch": Parameter(0.03, math.nan, "m")}, None, None)
    report = GapReport(
        ("A.h5",), "explained", "because", gap={"x": {"force": GapFigures(math.inf, 0.1, "N")}},
        causes=(cause,),
    )  # fmt: skip
    plain = json.loads(json.dumps(report.to_json(), allow_nan=False))
    assert plain["gap"] == {"x": {"force": {"nominal": None, "floor": 0.1, "unit": "N"}}}
    assert plain["causes"][0]["parameters"]["pitch"] == {"value": 0.03, "sigma": None, "unit": "m"}
    assert plain["next_experiment"] is None


def test_a_cell_has_a_range_or_a_value():
    phase = Where("x", "force", "phase", 0.4, value="onset")
    place = Where("x", "force", "position", 0.4, range=(0.0, 0.01), unit="m")
    assert finding_json(phase) == {
        "axis": "x", "signal": "force", "by": "phase", "value": "onset", "share": 0.4
    }  # fmt: skip
    assert finding_json(place)["range"] == [0.0, 0.01]
    assert "value" not in finding_json(place)


def test_an_unknown_verdict_is_refused():
    with pytest.raises(ValueError, match="verdict: 'perhaps'"):
        GapReport((), "perhaps", "")


def undescribed(schema):
    """A schema without its descriptions, which pydantic takes from docstrings in some versions."""
    if isinstance(schema, list):
        return [undescribed(each) for each in schema]
    if not isinstance(schema, dict):
        return schema
    return {key: undescribed(value) for key, value in schema.items() if key != "description"}


def test_the_published_schema_is_that_of_the_report():
    for name, made in SCHEMAS.items():
        published = json.loads((FOLDER / name).read_text(encoding="utf-8"))
        assert undescribed(published) == undescribed(made())


def test_the_schema_names_what_a_report_holds():
    told = GapReport(("A.h5",), "no_gap", "because").to_json()
    assert set(schema()["properties"]) == set(told)
