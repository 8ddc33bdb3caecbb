"""The report's JSON: plain, and null where a figure is not known."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from sim2real.empirical_force import EmpiricalForce
from sim2real.findings import (
    Cause,
    FigureChange,
    GapFigures,
    GapReport,
    Parameter,
    Where,
    finding_json,
    schema,
)
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


def test_a_change_is_written_to_two_digits_of_its_sigma():
    change = FigureChange("x", "mass", 24.0, 24.1284, 0.0123, "kg", True, "better")
    assert change.texts() == ("24.000", "24.128", "0.012")
    coarse = FigureChange("x", "coulomb", 6.0, 9.0, 2.0, "N", True, "better")
    assert coarse.texts() == ("6.0", "9.0", "2.0")


def test_a_description_is_the_effects_that_a_simulation_takes():
    force = EmpiricalForce(
        "x", 0.9, (0.0, 0.1), (1.0, 2.0), (0.5, -0.5), coulomb=(1.1, 0.9), velocity=(-1.0, 1.0),
        over_velocity=(-3.0, 3.0), motor_force=(0.0, 10.0), lost=(0.0, 1.0), path=(1e-3,),
        resistance=(2.0,), reading=(0.0, 0.1), misread=(0.0, 1e-6),
        turned=(2.0,), lagging=(0.5,), gain_at=(0.0, 0.1), gain=(0.9, 1.1),
    )  # fmt: skip
    effects = dict(force.effects())
    assert effects["residual_table"] == {
        "position": (0.0, 0.1), "force": (1.0, 2.0), "coulomb": (1.1, 0.9),
        "velocity": (-1.0, 1.0), "velocity_force": (-3.0, 3.0),
    }  # fmt: skip
    assert effects["motor_loss_table"] == {"motor_force": (0.0, 10.0), "loss": (0.0, 1.0)}
    assert effects["cable_hysteresis"] == {"force": 2.0, "stiffness": pytest.approx(2000.0)}
    assert effects["motor_hysteresis_table"] == {"width": (2.0,), "loss": (0.5,)}
    assert effects["motor_gain_table"] == {"position": (0.0, 0.1), "factor": (0.9, 1.1)}
    assert effects["misreading_table"] == {"position": (0.0, 0.1), "error": (0.0, 1e-6)}


def test_what_repeats_itself_goes_on_beyond_the_recorded_places():
    at = np.linspace(-0.04, 0.05, 91)
    wave = np.sin(2.0 * math.pi * at / 0.03)
    force = EmpiricalForce(
        "x", 0.9, tuple(at), tuple(2.0 * wave), tuple(wave), coulomb=tuple(1.0 + 0.2 * wave),
        velocity=(-1.0, 1.0), over_velocity=(0.0, 0.0), gain_at=tuple(at),
        gain=tuple(1.0 + 0.1 * wave), period=0.03,
    )  # fmt: skip
    effects = dict(force.effects())
    beyond = np.array([-0.12, -0.0525, 0.0575, 0.1325])
    expected = np.sin(2.0 * math.pi * beyond / 0.03)
    table, gain = effects["residual_table"], effects["motor_gain_table"]
    for nodes, heights, size, middle in (
        (table["position"], table["force"], 2.0, 0.0),
        (table["position"], table["coulomb"], 0.2, 1.0),
        (gain["position"], gain["factor"], 0.1, 1.0),
    ):
        there = np.interp(beyond, nodes, heights)
        np.testing.assert_allclose(there, middle + size * expected, atol=0.02 * size)
    nodes = np.array(table["position"])
    assert (np.diff(nodes) > 0.0).all()
    assert nodes[0] == pytest.approx(-0.13, abs=1e-3)
    assert nodes[-1] == pytest.approx(0.14, abs=1e-3)
    fine = replace(force, period=1e-3)
    assert len(fine.table()["position"]) <= 1000


def test_a_description_has_no_table_of_zeros():
    zeros = (0.0, 0.0)
    force = EmpiricalForce(
        "x", 0.9, (0.0, 0.1), zeros, zeros, coulomb=(1.0, 1.0), velocity=(-1.0, 1.0),
        over_velocity=zeros, reading=(0.0, 0.1), misread=(0.0, 1e-6),
    )  # fmt: skip
    assert [name for name, _ in force.effects()] == ["misreading_table"]


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
