"""Machine files with effects added."""

import pytest
import yaml

from stagectl.config import load_machine, parse_machine, stage_settings
from stagectl.config.machine.twin import render_twin
from stagectl.errors import ConfigError, StagectlError


def test_a_twin_is_a_machine_file_with_the_effects_and_figures():
    machine = load_machine()
    effects = {"x": [("cogging", {"amplitude": 1.2, "pitch": 0.032, "phase": 0.4})]}
    twin = parse_machine(render_twin(machine, effects, {"y": {"mass": 14.02, "coulomb": 9.1}}), "t")
    assert [e.name for e in twin.axes["x"].effects] == ["cogging"]
    assert twin.axes["y"].plant.mass == 14.02
    assert twin.axes["y"].plant.friction.coulomb == 9.1
    before, after = stage_settings(machine), stage_settings(twin)
    assert after.axes[0].effects
    assert after.axes[0].control == before.axes[0].control
    again = parse_machine(render_twin(twin, {"x": [("force_offset", {"force": -1.0})]}), "t")
    assert [e.name for e in again.axes["x"].effects] == ["cogging", "force_offset"]


def test_unknown_axes_and_parameters_and_bad_values_are_refused():
    machine = load_machine()
    with pytest.raises(StagectlError, match="no axis z"):
        render_twin(machine, {"z": []})
    with pytest.raises(StagectlError, match="no parameter charm"):
        render_twin(machine, {}, {"x": {"charm": 1.0}})
    with pytest.raises(ConfigError, match="mass"):
        render_twin(machine, {}, {"x": {"mass": -1.0}})


def test_a_twin_has_tables_and_says_what_they_are():
    places = tuple(0.03 + 0.5e-6 * i / 12 for i in range(13))  # a small motion far from zero
    table = {
        "position": places, "force": (1.0 / 3.0,) * 13, "coulomb": (1.1,) * 13,
        "velocity": (-1e-6, 1e-6), "velocity_force": (-1e-3, 1e-3),
    }  # fmt: skip
    text = render_twin(load_machine(), {"x": [("residual_table", table)]}, comments=("no cause",))
    assert text.splitlines()[1] == "# no cause"
    twin = parse_machine(text, "t")
    again = parse_machine(render_twin(twin, {}), "t")
    for machine in (twin, again):
        (applied,) = stage_settings(machine).axes[0].effects
        assert applied.parameters == table
    with pytest.raises(ConfigError, match="force: must have 13 values like position, has 2"):
        render_twin(twin, {"x": [("residual_table", table | {"force": (1.0, 2.0)})]})


def test_a_twin_in_another_folder_finds_the_files_that_its_machine_file_names(tmp_path):
    given = yaml.safe_load(render_twin(load_machine(), {}))
    for axis in given["axes"].values():
        axis["eds"], axis["drive"]["profile"] = "drives/d.eds", "own.yaml"
    source = tmp_path / "machines" / "stage.yaml"
    source.parent.mkdir()
    source.write_text(yaml.safe_dump({**given, "history": "stage.db"}))
    machine = load_machine(source)
    twin = parse_machine(render_twin(machine, {}, folder=tmp_path / "gap"), "t")
    assert {axis.eds for axis in twin.axes.values()} == {"../machines/drives/d.eds"}
    assert {axis.drive.profile for axis in twin.axes.values()} == {"../machines/own.yaml"}
    assert twin.history == "../machines/stage.db"
    # Nobody knows where the files were that the machine file in a recording names.
    recorded = parse_machine(source.read_text(), "recording.h5:machine")
    assert "eds: drives/d.eds" in render_twin(recorded, {}, folder=tmp_path / "gap")


def test_paths_left_empty_stay_empty_in_a_twin(tmp_path):
    given = yaml.safe_load(render_twin(load_machine(), {}))
    for axis in given["axes"].values():
        axis["eds"] = axis["drive"]["profile"] = None
    source = tmp_path / "stage.yaml"
    source.write_text(yaml.safe_dump({**given, "history": None}))
    twin = parse_machine(render_twin(load_machine(source), {}, folder=tmp_path / "gap"), "t")
    assert twin.history is None
    assert {axis.eds for axis in twin.axes.values()} == {None}
