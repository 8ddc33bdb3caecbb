"""Foreign data as recordings."""

import os
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from hil_sim.plant import simulate
from sim2real.gap import measure_gap
from stagectl.config import stage_settings
from stagectl.config.import_map import load_map
from stagectl.errors import ConfigError, UnusableInput
from stagectl.store import import_recording, read_recording, write_recording

EXAMPLE = Path(__file__).parents[4] / "examples" / "emps"
DATA = "STAGECTL_EMPS"


@pytest.fixture
def example():
    return load_map(EXAMPLE / "map.yaml")


@pytest.fixture(scope="module")
def columns():
    """What the example's machine would have logged, in the data's own columns and units."""
    _, machine = load_map(EXAMPLE / "map.yaml")
    settings = stage_settings(machine)
    t = np.arange(3000) * 1e-3
    demand = (0.05 * np.sin(np.pi * t) ** 2)[:, None]
    response = simulate(settings, demand, np.zeros_like(demand), None)
    volts = response.force[:, 0] / 35.15065188248547
    return {
        "t": t, "qg": demand[:, 0], "qm": response.position[:, 0],
        "vir": np.concatenate((volts[1:], volts[-1:])),
    }  # fmt: skip


def csv_of(columns, path, header=True, delimiter=","):
    lines = [delimiter.join(columns)] if header else []
    lines += [
        delimiter.join(f"{v:.17g}" for v in row) for row in zip(*columns.values(), strict=True)
    ]
    path.write_text("\n".join(lines) + "\n")
    return path


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


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda c: c | {"qm": np.where(np.arange(3000) == 7, np.nan, c["qm"])}, "qm: sample 7"),
        (lambda c: {k: v for k, v in c.items() if k != "vir"}, "no column 'vir'; it has qg, qm"),
        (lambda c: c | {"t": c["t"] * 100}, "0.1 s apart"),
        (lambda c: c | {"t": c["t"][::-1]}, "not later"),
        (lambda c: c | {"qm": c["qm"][:100]}, "100 samples, the demand has 3000"),
    ],
)
def test_unsuitable_data_are_one_line(example, columns, tmp_path, spoil, words):
    savemat(tmp_path / "bad.mat", spoil(columns))
    with pytest.raises(UnusableInput, match=words) as refused:
        import_recording(tmp_path / "bad.mat", *example)
    assert "bad.mat" in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.mat", b"no such thing", "not a readable"),
        ("a.mat", b"\x89HDF\r\n\x1a\n" + bytes(600), "not a readable"),
        ("a.xyz", b"", "only .mat and .csv"),
        ("a.csv", b"", "empty"),
        ("a.csv", b"t,qg\n1,2\n3\n", "row 3: 1 values"),
        ("a.csv", b"t,qg\n1,x\n", "column qg: 'x' is not a number"),
        ("a.csv", b"\xff\xfe\x00", "not readable text"),
    ],
)
def test_unreadable_files_are_one_line(example, tmp_path, name, content, words):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(UnusableInput, match=words):
        import_recording(tmp_path / name, *example)


def test_a_map_must_fit_its_machine(tmp_path):
    (tmp_path / "machine.yaml").write_text((EXAMPLE / "machine.yaml").read_text())
    text = (EXAMPLE / "map.yaml").read_text()
    for old, new, words in (
        ("slide:", "sled:", "no axis sled"),
        ("{column: qm}", "{column: qm, unit: furlong}", "unknown unit 'furlong'"),
        ("machine.yaml", "missing.yaml", r"missing\.yaml"),
    ):
        (tmp_path / "map.yaml").write_text(text.replace(old, new))
        with pytest.raises(ConfigError, match=words):
            load_map(tmp_path / "map.yaml")


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
