"""Recordings into the off-line identification, and what its command says of them."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from stagectl.cli.identify import command
from stagectl.config.machine import load_machine
from stagectl.errors import UnusableInput
from stagectl.identify import identify_axis
from stagectl.store.recording import read_recording

DATA = Path(__file__).parents[1] / "data"


@pytest.fixture(scope="module")
def recording():
    """The reference stage, recorded by an independent program; its first six seconds."""
    whole = read_recording(DATA / "null-3.h5")
    count = 6000
    axes = {
        name: replace(
            a, position_demand=a.position_demand[:count], force_offset=a.force_offset[:count],
            position_actual=a.position_actual[:count], force_actual=a.force_actual[:count],
            statusword=None, valid=a.valid[:count],
        )
        for name, a in whole.axes.items()
    }  # fmt: skip
    return replace(whole, time=whole.time[:count], axes=axes, moves=())


def test_the_reference_stage_is_the_machine_file(recording):
    found = identify_axis([recording], load_machine(), "x")
    assert found.reason is None
    # The stage's own figures differ from the file's by 0.3 %, and the Coulomb force wanders by 1 %.
    limits = {
        "coulomb": 0.02, "viscous": 0.02, "stiffness": 0.02, "relaxation_rate": 0.06,
        "static_ratio": 0.06, "stribeck_velocity": 0.06, "stribeck_shape": 0.08,
    }  # fmt: skip
    for name, limit in limits.items():
        assert found[name].verdict == "estimated"
        assert found[name].value == pytest.approx(found[name].prior, rel=limit), name
    assert abs(found["asymmetry"].value) < 4 * found["asymmetry"].sigma < 0.06
    for i in range(1, 11):
        for name in (f"k_{i}", f"nu_{i}"):
            assert found[name].value == pytest.approx(found[name].prior, rel=0.3), name
    assert found.misfit < 1.1
    assert found.held_out < 1.2


def test_other_periods_and_axes_are_refused(recording):
    slow = replace(recording, time=recording.time * 2.0)
    with pytest.raises(UnusableInput, match=r"null-3\.h5: axis x: SYNC period is 0\.002 s"):
        identify_axis([slow], load_machine(), "x")
    lone = replace(recording, axes={"y": recording.axes["y"]})
    with pytest.raises(UnusableInput, match="no such axis"):
        identify_axis([lone], load_machine(), "x")


def test_command_prints_and_writes_the_same(tmp_path):
    out = tmp_path / "friction.json"
    arguments = ["--axis", "y", "--elements", "3", "--json", str(out)]
    result = CliRunner().invoke(command, [str(DATA / "null-2.h5"), *arguments])
    assert result.exit_code == 0, result.output
    report = json.loads(out.read_text())
    assert (report["format"], report["version"]) == ("stagectl-friction", 1)
    assert list(report["axes"]) == ["y"]
    axis = report["axes"]["y"]
    figures = axis["figures"]
    assert {"unit", "prior", "prior_sigma", "value", "sigma", "gain", "verdict"} == set(
        figures["static_ratio"]
    )
    assert axis["refused"] is None
    assert sum(figures[f"k_{i}"]["value"] for i in (1, 2, 3)) == pytest.approx(1.0)
    for name in ("static_ratio", "force_offset [N]", "estimated", "held out"):
        assert name in result.output
    assert max(len(line) for line in result.output.splitlines()) <= 82
    assert np.isfinite(axis["misfit"]["after"])


def test_command_names_what_it_cannot_use():
    with pytest.raises(UnusableInput, match="no axis 'z', it has x, y"):
        CliRunner().invoke(
            command, [str(DATA / "null-2.h5"), "--axis", "z"], catch_exceptions=False
        )
