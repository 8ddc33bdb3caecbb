"""Foreign data as recordings."""

import os
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from sim2real.gap import measure_gap
from stagectl.config import parse_machine, stage_settings
from stagectl.errors import ConfigError, UnusableInput
from stagectl.importing import import_recording, load_map
from stagectl.store import read_recording, write_recording
from tests.unit.stagectl.logged_data import AXIS, EXAMPLE, MACHINE, csv_of, logged, read

DATA = "STAGECTL_EMPS"
TIMED = "time: {column: t}\n"
RESAMPLED = TIMED + "resample: true\n"


@pytest.fixture
def example():
    return load_map(EXAMPLE / "map.yaml")


def test_mat_and_csv_give_the_recording_of_the_machine(example, columns, tmp_path):
    savemat(tmp_path / "a.mat", {name: v[:, None] for name, v in columns.items()})
    for path in (tmp_path / "a.mat", csv_of(columns, tmp_path / "a.csv", delimiter=";")):
        recording = import_recording(path, *example)
        gap = measure_gap(recording, stage_settings(example[1]), draws=1)["slide"]
        assert gap["force"].nominal < 0.01
        assert gap["position"].nominal < 1e-8
        assert len(recording.moves) == 6
        assert recording.axes["slide"].valid.sum() == 2700
        write_recording(recording, tmp_path / "a.h5")
        assert len(read_recording(tmp_path / "a.h5")) == 3000


def test_columns_by_number_units_and_offsets(columns, tmp_path):
    numbered = (
        "  slide:\n    position_demand: {column: 2, unit: mm}\n"
        "    position_actual: {column: 3, unit: um, offset: 1.0e-3}\n"
        "    force_actual: {column: 4, unit: mN}\n"
    )
    path = csv_of(columns, tmp_path / "a.csv", header=False)
    axis = read(tmp_path, path, axis=numbered).axes["slide"]
    np.testing.assert_allclose(axis.position_demand, columns["qg"] * 1e-3)
    np.testing.assert_allclose(axis.position_actual, columns["qm"] * 1e-6 + 1e-3)
    np.testing.assert_allclose(axis.force_actual, columns["vir"] * 1e-3)
    assert not axis.force_offset.any()


@pytest.mark.parametrize(("delay", "first", "last"), [(2, [0, 0, 0, 1], 2997), (-2, [2, 3], 2999)])
def test_a_channel_is_shifted_by_samples_either_way(columns, tmp_path, delay, first, last):
    numbered = columns | {"vir": np.arange(3000.0)}
    axis = AXIS.replace("{column: vir}", f"{{column: vir, delay: {delay}}}")
    force = logged(tmp_path, numbered, axis=axis).axes["slide"].force_actual
    scale = force[-1] / last
    np.testing.assert_allclose(force[: len(first)], scale * np.array(first))
    with pytest.raises(UnusableInput, match="delay must be -1000 to 1000 samples"):
        logged(tmp_path, columns, axis=axis.replace(f"delay: {delay}", "delay: -1001"))


def test_motion_in_one_file_and_force_in_another(columns, tmp_path):
    """The force has a clock of its own: it is read at the samples of the motion."""
    motion = csv_of({k: columns[k] for k in ("t", "qg", "qm")}, tmp_path / "motion.csv")
    at = np.arange(0.0, 3.0, 0.7e-3)
    csv_of({"t": at, "I": np.interp(at, columns["t"], columns["vir"])}, tmp_path / "force.csv")
    axis = AXIS.replace("{column: vir}", "{column: I, file: force}")
    head = "time: {column: t}\nfiles: {force: {path: force.csv, time: {column: t}}}\n"
    slide = read(tmp_path, motion, head, axis).axes["slide"]
    assert np.std(slide.force_actual - columns["vir"]) < 0.03 * np.std(columns["vir"])
    with pytest.raises(ConfigError, match="no such file in `files`: force"):
        read(tmp_path, motion, axis=axis)


@pytest.mark.parametrize("rate", [1300.0, 5e3])
def test_uneven_and_frequent_samples_are_read_at_whole_periods(columns, tmp_path, rate):
    rng = np.random.default_rng(2)
    at = np.arange(0.0, 2.9, 1.0 / rate)
    at[1:] += rng.uniform(-0.2, 0.2, len(at) - 1) / rate
    hole = (at > 1.5) & (at < 1.52)
    log = {"t": at} | {k: np.interp(at, columns["t"], columns[k]) for k in ("qg", "qm", "vir")}
    log = {k: v[~hole] for k, v in log.items()}
    with pytest.raises(UnusableInput, match="resample: true"):
        logged(tmp_path, log, TIMED)
    found = logged(tmp_path, log, RESAMPLED)
    slide = found.axes["slide"]
    np.testing.assert_allclose(np.diff(found.time), 1e-3)
    off = (slide.position_actual - columns["qm"][: len(found)])[slide.valid]
    assert np.abs(off).max() < 2e-6
    assert (~slide.valid).sum() == pytest.approx(20, abs=1)


def test_no_samples_are_invented(columns, tmp_path):
    slow = {k: v[::10] for k, v in columns.items()}
    with pytest.raises(UnusableInput, match="choose a sync_period of about"):
        logged(tmp_path, slow, RESAMPLED)
    slower = MACHINE.replace("sync_period: 0.001", "sync_period: 0.01")
    assert len(logged(tmp_path, slow, TIMED, machine=slower)) == 300


@pytest.mark.parametrize("resample", ["", "resample: true\n"])
@pytest.mark.parametrize(("factor", "stated", "asked"), [(1e3, "", "ms"), (1.0, ", unit: ms", "s")])
def test_times_in_another_unit_are_asked_about(columns, tmp_path, factor, stated, asked, resample):
    path = csv_of(columns | {"t": columns["t"] * factor}, tmp_path / "a.csv")
    with pytest.raises(UnusableInput, match=f"are the times in {asked}\\? Then") as error:
        read(tmp_path, path, f"time: {{column: t{stated}}}\n{resample}")
    assert "reads them" not in str(error.value)


def test_a_resampling_that_leaves_next_to_nothing_is_refused(columns, tmp_path):
    path = csv_of(columns | {"t": columns["t"] * 2e-3}, tmp_path / "a.csv")
    with pytest.raises(UnusableInput, match=r"6 of 3000 rows are left; choose a shorter"):
        read(tmp_path, path, "time: {column: t}\nresample: true\n")


@pytest.mark.parametrize("pause", [1.7e9, 1e4])
def test_one_wrong_date_is_no_recording_of_years(columns, tmp_path, pause):
    log = columns | {"t": columns["t"] + pause * (np.arange(3000) >= 17)}
    with pytest.raises(UnusableInput, match=r"s pass between samples 16 and 17: the holes are"):
        logged(tmp_path, log, RESAMPLED)


def test_a_pause_shorter_than_what_was_logged_is_a_hole(columns, tmp_path):
    log = columns | {"t": columns["t"] + 2.0 * (np.arange(3000) >= 1000)}
    found = logged(tmp_path, log, RESAMPLED)
    assert (~found.axes["slide"].valid).sum() == pytest.approx(2000, abs=2)


def test_without_a_demand_the_measured_position_is_one(columns, tmp_path):
    axis = AXIS.replace("    position_demand: {column: qg}\n", "")
    slide = logged(tmp_path, columns, axis=axis).axes["slide"]
    np.testing.assert_allclose(slide.position_demand, columns["qm"], atol=2e-6)


def test_moves_of_a_log_that_lost_rows_are_where_its_samples_are(columns, tmp_path):
    axis = AXIS.replace("    position_demand: {column: qg}\n", "")
    whole = logged(tmp_path, columns, TIMED, axis=axis)
    lost = slice(1500, 1503)
    log = {name: np.delete(values, lost) for name, values in columns.items()}
    found = logged(tmp_path, log, TIMED, axis=axis)
    assert len(found.moves) == len(whole.moves) > 2
    for ours, theirs in zip(found.moves, whole.moves, strict=True):
        assert found.time[ours.start] == pytest.approx(whole.time[theirs.start], abs=0.02)
    assert found.moves[-1].end == len(found)


def test_a_velocity_is_integrated_to_the_position(columns, tmp_path):
    log = columns | {"v": np.gradient(columns["qm"], columns["t"]) * 1e3}
    axis = AXIS.replace("{column: qm}", "{column: v, unit: mm/s, integrate: true}")
    slide = logged(tmp_path, log, axis=axis).axes["slide"]
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
    slide = logged(tmp_path, log, axis=axis).axes["slide"]
    moved = columns["qm"] - columns["qm"][0]
    np.testing.assert_allclose(slide.position_actual - slide.position_actual[0], moved, atol=1e-9)


def test_samples_of_one_instant_count_once(columns, tmp_path):
    twice = {name: np.repeat(values, 2) for name, values in columns.items()}
    with pytest.raises(UnusableInput, match=r"sample 1: not later .* `resample: true`"):
        logged(tmp_path, twice, TIMED)
    slide = logged(tmp_path, twice, RESAMPLED).axes["slide"]
    np.testing.assert_allclose(slide.force_actual, columns["vir"], atol=1e-9)


@pytest.mark.parametrize(
    ("suffix", "spoil", "words"),
    [
        (
            "csv",
            lambda c: {"qm": np.where(np.arange(3000) == 7, np.nan, c["qm"])},
            "sample 7: is n",
        ),
        ("csv", lambda c: {"voltage": c["vir"]}, "no column 'vir'; it has"),
        ("csv", lambda c: {"t": c["t"] * 100}, "0.1 s apart"),
        ("csv", lambda c: {"t": c["t"][::-1]}, "earlier than the one before"),
        ("mat", lambda c: {"qm": c["qm"][:100]}, "100 samples, the demand has 3000"),
    ],
)
def test_unsuitable_data_are_one_line(example, columns, tmp_path, suffix, spoil, words):
    path = tmp_path / f"bad.{suffix}"
    bad = columns | spoil(columns)
    if "voltage" in bad:
        del bad["vir"]
    savemat(path, bad) if suffix == "mat" else csv_of(bad, path)
    with pytest.raises(UnusableInput, match=words) as refused:
        import_recording(path, *example)
    assert path.name in str(refused.value)
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
    alone = "  slide: {position_actual: {column: qm}}\n"
    write_recording(logged(tmp_path, columns, TIMED, axis=alone), tmp_path / "log.h5")
    recording = read_recording(tmp_path / "log.h5")
    assert recording.axes["slide"].missing == ("position_demand", "force_actual")
    assert not recording.axes["slide"].force_actual.any()
    machine = parse_machine(recording.machine, "log.h5")
    with pytest.raises(ValueError, match="slide: position_demand and force_actual not logged"):
        measure_gap(recording, stage_settings(machine))
