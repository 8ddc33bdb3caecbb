"""`stagectl gap import`: data of another program, and what it never overwrites."""

import h5py
from click.testing import CliRunner

from stagectl.cli.gap_import import import_data
from stagectl.store import read_recording
from tests.unit.stagectl.logged_data import AXIS, MACHINE, csv_of


def test_positions_in_another_scale_than_their_demand_are_pointed_out(columns, tmp_path):
    (tmp_path / "machine.yaml").write_text(MACHINE)
    (tmp_path / "map.yaml").write_text(f"machine: machine.yaml\naxes:\n{AXIS}")
    csv_of(columns | {"qm": 1.2 * columns["qm"]}, tmp_path / "log.csv")
    log, how, target = (str(tmp_path / name) for name in ("log.csv", "map.yaml", "log.h5"))
    done = CliRunner().invoke(import_data, [log, "--map", how, "--out", target])
    assert done.exit_code == 0
    assert "axis slide: position_actual is scaled by 1.2" in done.output
    assert "measured by position_demand: check the map" in done.output


def test_data_of_the_recordings_suffix_are_not_overwritten(columns, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "machine.yaml").write_text(MACHINE)
    (tmp_path / "map.yaml").write_text(f"machine: machine.yaml\naxes:\n{AXIS}")
    with h5py.File("log.h5", "w") as file:
        for name, values in columns.items():
            file[name] = values
    refused = CliRunner().invoke(import_data, ["log.h5", "--map", "map.yaml"])
    assert refused.exit_code == 2
    assert "log.h5: is DATA itself" in refused.output
    arguments = ["log.h5", "--map", "map.yaml", "--out", "recorded.h5"]
    done = CliRunner().invoke(import_data, arguments)
    assert done.exit_code == 0, done.output
    assert "recorded.h5: 3000 samples" in done.output
    assert len(read_recording(tmp_path / "recorded.h5")) == 3000
