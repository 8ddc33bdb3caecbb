"""Bad input of `gap diagnose`: one line, exit 2, or a report that says insufficient."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
import yaml
from click.testing import CliRunner

from stagectl.cli.gap_diagnose import _keep_measurement, diagnose
from stagectl.cli.gap_import import import_data
from stagectl.config import load_machine
from stagectl.errors import StagectlError
from stagectl.measurement import Measurement, measure_virtual_stage
from tests.unit.sim2real.other_machines import TOOL

DATA = Path(__file__).parents[3] / "data"
KEPT = 1200


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """The first 1.2 s of a recording."""
    path = tmp_path_factory.mktemp("gap") / "small.h5"
    with h5py.File(DATA / "null-2.h5") as whole, h5py.File(path, "w") as cut:
        for name, value in whole.attrs.items():
            cut.attrs[name] = value
        cut["time"] = whole["time"][:KEPT]
        for axis in whole["axes"]:
            for channel, dataset in whole["axes"][axis].items():
                cut[f"axes/{axis}/{channel}"] = dataset[:KEPT]
        moves = whole["moves"][()]
        cut["moves"] = moves[moves["end"] <= KEPT]
    return path


def run(*arguments):
    """What the command answers: (report, "") or (None, one line)."""
    done = CliRunner().invoke(diagnose, [*map(str, arguments), "--json", "-"])
    if done.exception is not None:
        assert isinstance(done.exception, StagectlError), repr(done.exception)
        assert done.exception.exit_code == 2
        return None, str(done.exception)
    return json.loads(done.stdout), ""


def spoilt(small, tmp_path, spoil):
    path = tmp_path / "spoilt.h5"
    shutil.copy(small, path)
    with h5py.File(path, "r+") as file:
        spoil(file)
    return path


def replaced(file, name, values):
    if name in file:
        del file[name]
    file[name] = values


def test_the_recording_itself_is_fine(small):
    report, _ = run(small)
    assert report["verdict"] == "no_gap"


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda f: f.__delitem__("axes/x/force_actual"), "/axes/x/force_actual: missing"),
        (lambda f: f.__delitem__("axes/y"), "the model has axes x, y, the recording x"),
        (lambda f: replaced(f, "axes/x/position_actual", np.zeros(7)), "7 samples"),
        (lambda f: replaced(f, "axes/x/force_actual", np.full(KEPT, np.nan)), "sample 0: is nan"),
        (lambda f: replaced(f, "axes/x/force_actual", np.zeros(KEPT, "S3")), "wrong kind"),
        (lambda f: replaced(f, "axes/x/force_actual", np.zeros((KEPT, 2))), "one dimension"),
        (lambda f: replaced(f, "time", np.zeros(KEPT)), "not later"),
        (lambda f: replaced(f, "time", np.arange(KEPT) * 1.4e-3), "0.0014 s apart"),
        (lambda f: f.attrs.__setitem__("version", 2), "newer"),
        (lambda f: f.attrs.__setitem__("machine", "machine: 3"), "machine"),
        (lambda f: f.attrs.__delitem__("machine"), "attribute machine: missing"),
    ],
)
def test_unusable_recordings_are_one_line(small, tmp_path, spoil, words):
    path = spoilt(small, tmp_path, spoil)
    report, line = run(path)
    assert report is None
    assert words in line
    assert "spoilt.h5" in line


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda f: replaced(f, "time", np.arange(KEPT) * 0.1), "10 Hz"),
        (lambda f: replaced(f, "axes/x/valid", np.zeros(KEPT, "u1")), "0 % of the samples"),
        (
            lambda f: [replaced(f, f"axes/{a}/position_demand", np.zeros(KEPT)) for a in "xy"],
            "no motion",
        ),
    ],
)
def test_recordings_with_too_little_motion_get_a_report(small, tmp_path, spoil, words):
    report, _ = run(spoilt(small, tmp_path, spoil))
    assert report["verdict"] == "insufficient"
    assert words in report["reason"]
    assert report["causes"] == []


def test_a_recording_that_cannot_judge_is_one_line(small, tmp_path):
    still = spoilt(
        small, tmp_path,
        lambda f: [replaced(f, f"axes/{a}/position_demand", np.zeros(KEPT)) for a in "xy"],
    )  # fmt: skip
    report, line = run(small, "--check", still)
    assert report is None
    assert line.startswith("--check: ")
    assert "no motion" in line


def test_the_curves_of_the_page_are_in_the_json(small, tmp_path):
    page = tmp_path / "gap.html"
    report, _ = run(small, "--check", small, "--html", page)
    assert report["gap_closed_elsewhere"] is None
    assert set(report["residuals"]) == {"x", "y"}
    assert report["residuals"]["x"]["over_velocity"]
    assert "over position and velocity" in page.read_text()


def test_without_a_diagnosis_there_is_no_twin(small, tmp_path):
    path = spoilt(
        small, tmp_path,
        lambda f: replaced(f, "axes/x/force_actual", -f["axes/x/force_actual"][()]),
    )  # fmt: skip
    twin = tmp_path / "twin.yaml"
    result = CliRunner().invoke(diagnose, [str(path), "--twin", str(twin)])
    assert result.exit_code == 0, result.output
    assert "twin.yamlisnotwritten:nocausewasfound" in "".join(result.output.split())
    assert not twin.exists()


def test_the_report_is_printed_before_a_twin_that_cannot_be_written(small):
    result = CliRunner().invoke(diagnose, [str(small), "--twin", "/dev/full"])
    assert "/dev/full: cannot write the machine file" in str(result.exception)
    assert "No gap" in result.output


@pytest.mark.slow
def test_a_twin_has_the_figures_fitted_and_says_why_it_cannot_run(tmp_path):
    data, how = TOOL.write(tmp_path)
    path, twin = tmp_path / "r.h5", tmp_path / "twin.yaml"
    CliRunner().invoke(import_data, [str(data), "--map", str(how), "--out", str(path)])
    result = CliRunner().invoke(diagnose, [str(path), "--twin", str(twin), "--jobs", "1"])
    assert "twin.yamlcannotrun:thecontrollergainsofa" in "".join(result.output.split())
    text = twin.read_text()
    assert "kg fitted; the machine file leaves it unknown" in text
    assert yaml.safe_load(text)["axes"]["a"]["plant"]["mass"] == pytest.approx(300.0, rel=0.05)


@pytest.mark.slow
def test_what_no_effect_explains_is_a_table_of_the_twin_beside_the_figures_found(tmp_path):
    def odd(t, x, v, a):
        over_place = 120.0 * np.tanh((x - 0.2) / 0.05)
        return TOOL.force(t, x, v, a) - 80.0 + over_place + 1500.0 * v * np.abs(v) * (x > 0.1)

    data, how = replace(TOOL, force=odd).write(tmp_path)
    path, twin = tmp_path / "r.h5", tmp_path / "twin.yaml"
    command = [str(data), "--map", str(how), "--out", str(path)]
    done = CliRunner().invoke(import_data, command)
    assert done.exit_code == 0, done.output
    report, _ = run(path, "--twin", twin, "--jobs", "1")
    assert report["verdict"] == "unexplained"
    (force,) = report["empirical"]
    axis = yaml.safe_load(twin.read_text())["axes"]["a"]
    (table,) = axis["effects"]
    assert table.pop("effect") == "residual_table"
    assert table["coulomb"] == pytest.approx(force["coulomb"], rel=1e-5)
    # Figures that the table stands beside, in place of `unknown`.
    figures = (axis["plant"]["mass"], *map(axis["plant"]["friction"].get, ("coulomb", "viscous")))
    assert all(isinstance(figure, float) and figure > 0.0 for figure in figures)


@pytest.mark.parametrize(
    ("channel", "value"),
    [("position_actual", 0.0), ("force_actual", 0.0), ("force_actual", 1e6), ("force_offset", 1e6)],
)
def test_a_dead_or_absurd_channel_is_never_a_traceback(small, tmp_path, channel, value):
    name = f"axes/x/{channel}"
    report, line = run(spoilt(small, tmp_path, lambda f: replaced(f, name, np.full(KEPT, value))))
    if report is None:
        assert len(line.splitlines()) == 1
    else:
        assert report["causes"] == []
        reported = {(c["axis"], c["channel"], c["finding"]) for c in report["channels"]}
        if channel != "force_offset":
            assert ("x", channel, "constant") in reported
            assert report["verdict"] == "insufficient"


def test_machine_files_that_do_not_fit(small, tmp_path):
    text = load_machine().text
    (tmp_path / "other.yaml").write_text(text.replace("  y:", "  z:"))
    assert "the model has axes x, z" in run(small, "--machine", tmp_path / "other.yaml")[1]
    (tmp_path / "slow.yaml").write_text(text.replace("sync_period: 0.001", "sync_period: 0.002"))
    assert "0.001 s apart" in run(small, "--machine", tmp_path / "slow.yaml")[1]
    assert "missing.yaml" in run(small, "--machine", tmp_path / "missing.yaml")[1]


def test_recordings_of_different_machines_need_the_machine_option(small, tmp_path):
    text = load_machine().text.replace("mass: 8.0", "mass: 8.1")
    other = spoilt(small, tmp_path, lambda f: f.attrs.__setitem__("machine", text))
    assert "--machine" in run(small, other)[1]


def test_damaged_bytes_are_one_line_or_a_report(small, tmp_path):
    whole = small.read_bytes()
    rng = np.random.default_rng(11)
    path = tmp_path / "damaged.h5"
    for _ in range(30):
        damaged = bytearray(whole)
        for place in rng.integers(0, min(len(whole), 6000), 12):
            damaged[place] = int(rng.integers(256))
        path.write_bytes(damaged[: int(rng.integers(100, len(damaged)))])
        report, line = run(path)
        assert report is not None or ("damaged.h5" in line and len(line.splitlines()) >= 1)


@pytest.mark.slow
def test_a_twin_keeps_the_measurement_of_the_real_stage(go, machine, sites, tmp_path):
    """It is on the same drives; that of a virtual stage is made again where it is needed."""
    virtual = measure_virtual_stage(machine, machine)
    real = Measurement("2026-01-01T00:00:00+00:00", virtual.machine, virtual.axes)
    for name, measurement in (("virtual", virtual), ("real", real)):
        go(sites, name, measurement=measurement)
        _keep_measurement(tmp_path / f"{name}.yaml", [tmp_path / name / "recording.h5"])
    assert not (tmp_path / "virtual.response.json").exists()
    assert (tmp_path / "real.response.json").read_text() == real.as_text()
