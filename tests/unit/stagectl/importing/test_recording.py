"""Foreign data as recordings."""

import os
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from sim2real.gap import measure_gap
from stagectl.config import stage_settings
from stagectl.errors import ConfigError, UnusableInput
from stagectl.importing import import_recording, load_map
from stagectl.store import read_recording, write_recording
from tests.unit.stagectl.logged_data import AXIS, EXAMPLE, MACHINE, csv_of, read

DATA = "STAGECTL_EMPS"


@pytest.fixture
def example():
    return load_map(EXAMPLE / "map.yaml")


def test_mat_and_csv_give_the_recording_of_the_machine(example, columns, tmp_path):
    savemat(tmp_path / "a.mat", {name: v[:, None] for name, v in columns.items()})
    for path in (
        tmp_path / "a.mat",
        csv_of(columns, tmp_path / "a.csv"),
        csv_of(columns, tmp_path / "b.csv", delimiter=";"),
    ):
        recording = import_recording(path, *example)
        gap = measure_gap(recording, stage_settings(example[1]), draws=1)["slide"]
        assert gap["force"].nominal < 0.01
        assert gap["position"].nominal < 1e-8
        assert len(recording.moves) == 6
        assert recording.axes["slide"].valid.sum() == 2700
        write_recording(recording, tmp_path / "a.h5")
        assert len(read_recording(tmp_path / "a.h5")) == 3000


def test_columns_by_number_units_and_offsets(columns, tmp_path):
    (tmp_path / "machine.yaml").write_text((EXAMPLE / "machine.yaml").read_text())
    (tmp_path / "map.yaml").write_text(
        "machine: machine.yaml\n"
        "axes:\n"
        "  slide:\n"
        "    position_demand: {column: 2, unit: mm}\n"
        "    position_actual: {column: 3, unit: um, offset: 1.0e-3}\n"
        "    force_actual: {column: 4, unit: mN}\n"
    )
    path = csv_of(columns, tmp_path / "a.csv", header=False)
    axis = import_recording(path, *load_map(tmp_path / "map.yaml")).axes["slide"]
    np.testing.assert_allclose(axis.position_demand, columns["qg"] * 1e-3)
    np.testing.assert_allclose(axis.position_actual, columns["qm"] * 1e-6 + 1e-3)
    np.testing.assert_allclose(axis.force_actual, columns["vir"] * 1e-3)
    assert not axis.force_offset.any()


def test_motion_in_one_file_and_force_in_another(columns, tmp_path):
    """The force has a clock of its own: it is read at the samples of the motion."""
    motion = csv_of({k: columns[k] for k in ("t", "qg", "qm")}, tmp_path / "motion.csv")
    at = np.arange(0.0, 3.0, 0.7e-3)
    force = np.interp(at, columns["t"], columns["vir"])
    csv_of({"t": at, "I": force}, tmp_path / "force.csv")
    slide = read(
        tmp_path, motion,
        "time: {column: t}\nfiles: {force: {path: force.csv, time: {column: t}}}\n",
        AXIS.replace("{column: vir}", "{column: I, file: force}"),
    ).axes["slide"]  # fmt: skip
    assert np.std(slide.force_actual - columns["vir"]) < 0.03 * np.std(columns["vir"])
    with pytest.raises(ConfigError, match="no such file in `files`: force"):
        read(tmp_path, motion, axis=AXIS.replace("{column: vir}", "{column: I, file: force}"))


@pytest.mark.parametrize("rate", [1300.0, 20e3])
def test_uneven_and_frequent_samples_are_read_at_whole_periods(columns, tmp_path, rate):
    rng = np.random.default_rng(2)
    at = np.arange(0.0, 2.9, 1.0 / rate)
    at[1:] += rng.uniform(-0.2, 0.2, len(at) - 1) / rate
    hole = (at > 1.5) & (at < 1.52)
    log = {"t": at} | {k: np.interp(at, columns["t"], columns[k]) for k in ("qg", "qm", "vir")}
    path = csv_of({k: v[~hole] for k, v in log.items()}, tmp_path / "a.csv")
    with pytest.raises(UnusableInput, match="resample: true"):
        read(tmp_path, path, "time: {column: t}\n")
    found = read(tmp_path, path, "time: {column: t}\nresample: true\n")
    slide = found.axes["slide"]
    np.testing.assert_allclose(np.diff(found.time), 1e-3)
    off = (slide.position_actual - columns["qm"][: len(found)])[slide.valid]
    assert np.abs(off).max() < 2e-6
    assert (~slide.valid).sum() == pytest.approx(20, abs=1)


def test_no_samples_are_invented(columns, tmp_path):
    slow = {k: v[::10] for k, v in columns.items()}
    path = csv_of(slow, tmp_path / "a.csv")
    with pytest.raises(UnusableInput, match="choose a sync_period of about"):
        read(tmp_path, path, "time: {column: t}\nresample: true\n")
    slower = MACHINE.replace("sync_period: 0.001", "sync_period: 0.01")
    found = read(tmp_path, path, "time: {column: t}\n", machine=slower)
    assert len(found) == 300


@pytest.mark.parametrize("pause", [1.7e9, 1e4])
def test_one_wrong_date_is_no_recording_of_years(columns, tmp_path, pause):
    log = columns | {"t": columns["t"] + pause * (np.arange(3000) >= 17)}
    path = csv_of(log, tmp_path / "a.csv")
    with pytest.raises(UnusableInput, match=r"s pass between samples 16 and 17: the holes are"):
        read(tmp_path, path, "time: {column: t}\nresample: true\n")


def test_a_pause_shorter_than_what_was_logged_is_a_hole(columns, tmp_path):
    log = columns | {"t": columns["t"] + 2.0 * (np.arange(3000) >= 1000)}
    path = csv_of(log, tmp_path / "a.csv")
    found = read(tmp_path, path, "time: {column: t}\nresample: true\n")
    assert (~found.axes["slide"].valid).sum() == pytest.approx(2000, abs=2)


def test_without_a_demand_the_measured_position_is_one(columns, tmp_path):
    axis = AXIS.replace("    position_demand: {column: qg}\n", "")
    slide = read(tmp_path, csv_of(columns, tmp_path / "a.csv"), axis=axis).axes["slide"]
    np.testing.assert_allclose(slide.position_demand, columns["qm"], atol=2e-6)


def test_a_velocity_is_integrated_to_the_position(columns, tmp_path):
    log = columns | {"v": np.gradient(columns["qm"], columns["t"]) * 1e3}
    axis = AXIS.replace("{column: qm}", "{column: v, unit: mm/s, integrate: true}")
    slide = read(tmp_path, csv_of(log, tmp_path / "a.csv"), axis=axis).axes["slide"]
    expected = columns["qm"] - columns["qm"][0]
    np.testing.assert_allclose(slide.position_actual, expected, atol=1e-6)
    with pytest.raises(ConfigError, match=r"position_actual.unit: unknown unit 'mm/s'"):
        read(tmp_path, tmp_path / "a.csv", axis=axis.replace(", integrate: true", ""))
    force = AXIS.replace("{column: vir}", "{column: vir, integrate: true}")
    with pytest.raises(ConfigError, match="only a velocity that stands for a position"):
        read(tmp_path, tmp_path / "a.csv", axis=force)


def test_an_angle_that_begins_anew_is_unwrapped(columns, tmp_path):
    log = columns | {"qm": np.mod(columns["qm"], 0.05)}
    axis = AXIS.replace("{column: qm}", "{column: qm, wrap: 0.05}")
    slide = read(tmp_path, csv_of(log, tmp_path / "a.csv"), axis=axis).axes["slide"]
    moved = columns["qm"] - columns["qm"][0]
    np.testing.assert_allclose(slide.position_actual - slide.position_actual[0], moved, atol=1e-9)


def test_samples_of_one_instant_count_once(columns, tmp_path):
    twice = {name: np.repeat(values, 2) for name, values in columns.items()}
    path = csv_of(twice, tmp_path / "a.csv")
    with pytest.raises(UnusableInput, match=r"sample 1: not later .* `resample: true`"):
        read(tmp_path, path, "time: {column: t}\n")
    slide = read(tmp_path, path, "time: {column: t}\nresample: true\n").axes["slide"]
    np.testing.assert_allclose(slide.force_actual, columns["vir"], atol=1e-9)


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (
            lambda c: c | {"qm": np.where(np.arange(3000) == 7, np.nan, c["qm"])},
            "qm: sample 7: is nan; `resample",
        ),
        (lambda c: {k: v for k, v in c.items() if k != "vir"}, "no column 'vir'; it has qg, qm"),
        (lambda c: c | {"t": c["t"] * 100}, "0.1 s apart"),
        (lambda c: c | {"t": c["t"][::-1]}, "earlier than the one before"),
        (lambda c: c | {"qm": c["qm"][:100]}, "100 samples, the demand has 3000"),
    ],
)
def test_unsuitable_data_are_one_line(example, columns, tmp_path, spoil, words):
    savemat(tmp_path / "bad.mat", spoil(columns))
    with pytest.raises(UnusableInput, match=words) as refused:
        import_recording(tmp_path / "bad.mat", *example)
    assert "bad.mat" in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.skipif(
    DATA not in os.environ,
    reason=f"REAL DATA NOT TESTED: set {DATA} to the folder of DATA_EMPS.mat",
)
def test_the_published_model_of_a_real_axis_is_as_close_as_published(example):
    recording = import_recording(Path(os.environ[DATA]) / "DATA_EMPS.mat", *example)
    slide = recording.axes["slide"]
    gap = measure_gap(recording, stage_settings(example[1]), draws=1)["slide"]
    relative = gap["force"].nominal / np.sqrt(np.mean(slide.force_actual[slide.valid] ** 2))
    assert relative < 0.0585  # what its authors report for their closed-loop simulation


def test_what_was_not_logged_is_remembered(columns, tmp_path):
    """A recording says it, and no loop is simulated over a demand that nobody sent."""
    data = csv_of(columns, tmp_path / "log.csv")
    how = tmp_path / "map.yaml"
    how.write_text(
        f"machine: {EXAMPLE / 'machine.yaml'}\ntime: {{column: t}}\n"
        "axes: {slide: {position_actual: {column: qm}}}\n"
    )
    mapped, machine = load_map(how)
    write_recording(import_recording(data, mapped, machine), tmp_path / "log.h5")
    recording = read_recording(tmp_path / "log.h5")
    assert recording.axes["slide"].missing == ("position_demand", "force_actual")
    assert not recording.axes["slide"].force_actual.any()
    with pytest.raises(ValueError, match="slide: position_demand and force_actual not logged"):
        measure_gap(recording, stage_settings(machine))
