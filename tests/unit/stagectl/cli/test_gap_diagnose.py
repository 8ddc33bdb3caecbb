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

from stagectl.cli.gap_compare import compare
from stagectl.cli.gap_diagnose import _keep_measurement, diagnose
from stagectl.cli.gap_import import import_data
from stagectl.cli.gap_measure import measure
from stagectl.config import load_machine
from stagectl.errors import StagectlError
from stagectl.measurement import Measurement, measure_virtual_stage
from stagectl.store import RecordingBlocks, write_recording
from tests.unit.sim2real.other_machines import TOOL

DATA = Path(__file__).parents[3] / "data"
KEPT = 1108


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """The first KEPT samples of a recording, which are four moves."""
    path = tmp_path_factory.mktemp("gap") / "small.h5"
    write_recording(next(iter(RecordingBlocks(DATA / "null-2.h5", 1250))), path)
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


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda f: f.__delitem__("axes/x/force_actual"), "/axes/x/force_actual: missing"),
        (lambda f: f.__delitem__("axes/y"), "the model has axes x, y, the recording x"),
        (lambda f: replaced(f, "time", np.arange(KEPT) * 1.4e-3), "0.0014 s apart"),
        (lambda f: f.attrs.__setitem__("machine", "machine: 3"), "machine"),
        (lambda f: f.attrs.__delitem__("machine"), "attribute machine: missing"),
    ],
)
def test_unusable_recordings_are_one_line(small, tmp_path, spoil, words):
    report, line = run(spoilt(small, tmp_path, spoil))
    assert report is None
    assert words in line
    assert "spoilt.h5" in line


def without_motion(file):
    for axis in "xy":
        replaced(file, f"axes/{axis}/position_demand", np.zeros(KEPT))


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda f: replaced(f, "time", np.arange(KEPT) * 0.1), "10 Hz"),
        (lambda f: replaced(f, "axes/x/valid", np.zeros(KEPT, "u1")), "0 % of the samples"),
        (without_motion, "no motion"),
    ],
)
def test_recordings_with_too_little_motion_get_a_report(small, tmp_path, spoil, words):
    report, _ = run(spoilt(small, tmp_path, spoil))
    assert report["verdict"] == "insufficient"
    assert words in report["reason"]
    assert report["causes"] == []


def test_a_recording_that_cannot_judge_is_left_out_with_its_reason(small, tmp_path):
    still = spoilt(small, tmp_path, without_motion)
    done = CliRunner().invoke(diagnose, [str(small), "--check", str(still), "--json", "-"])
    assert done.exit_code == 0
    assert json.loads(done.stdout)["gap_closed_elsewhere"] is None
    assert done.stderr.startswith("--check is left out: ")
    assert "no motion" in done.stderr


def test_the_recording_itself_is_fine_and_the_curves_of_its_page_are_in_the_json(small, tmp_path):
    page, twin = tmp_path / "gap.html", tmp_path / "twin.yaml"
    report, _ = run(small, "--check", small, "--html", page, "--twin", twin)
    assert (report["format"], report["version"]) == ("stagectl-gap-report", 2)
    assert report["recordings"] == [str(small)]
    assert (report["verdict"], report["channels"], report["causes"]) == ("no_gap", [], [])
    assert load_machine(twin).axes["x"].plant == load_machine().axes["x"].plant
    assert report["gap_closed_elsewhere"] is None
    assert set(report["residuals"]) == {"x", "y"}
    assert report["residuals"]["x"]["over_velocity"]
    text = page.read_text()
    assert "No gap" in text
    assert "over position and velocity" in text


def test_without_a_diagnosis_there_is_no_twin(small, tmp_path):
    force = "axes/x/force_actual"
    path = spoilt(small, tmp_path, lambda f: replaced(f, force, -f[force][()]))
    twin = tmp_path / "twin.yaml"
    result = CliRunner().invoke(diagnose, [str(path), "--twin", str(twin)])
    assert result.exit_code == 0, result.output
    assert "twin.yamlisnotwritten:nocausewasfound" in "".join(result.output.split())
    assert not twin.exists()


def test_the_report_is_printed_before_a_twin_that_cannot_be_written(small):
    result = CliRunner().invoke(diagnose, [str(small), "--twin", "/dev/full"])
    assert "/dev/full: cannot write the machine file" in str(result.exception)
    assert "No gap" in result.output


def imported(machine, tmp_path):
    """The recording of another machine's motion, and the name of a twin."""
    data, how = machine.write(tmp_path)
    arguments = [str(data), "--map", str(how), "--out", str(tmp_path / "r.h5")]
    done = CliRunner().invoke(import_data, arguments)
    assert done.exit_code == 0, done.output
    return tmp_path / "r.h5", tmp_path / "twin.yaml"


@pytest.mark.slow
def test_a_twin_has_the_figures_fitted_and_says_why_it_cannot_run(tmp_path):
    path, twin = imported(TOOL, tmp_path)
    result = CliRunner().invoke(diagnose, [str(path), "--twin", str(twin), "--jobs", "1"])
    said = "".join(result.output.split())
    assert "twin.yamlisfor`gapmeasure`and`gapcompare`andcannotrun:thecontroller" in said
    text = twin.read_text()
    assert "kg fitted; the machine file leaves it unknown" in text
    assert yaml.safe_load(text)["axes"]["a"]["plant"]["mass"] == pytest.approx(300.0, rel=0.05)
    measured = CliRunner().invoke(measure, [str(path), "--machine", str(twin), "--json", "-"])
    assert measured.exit_code == 0, measured.output
    force = json.loads(measured.output)["gap"]["a"]["force"]
    assert force["nominal"] < 1.5 * force["floor"]
    worse = tmp_path / "worse.yaml"
    worse.write_text(text.replace("effects:", "effects: []\n    was:").split("    was:")[0])
    compared = CliRunner().invoke(compare, [str(worse), str(twin), str(path), "--json", "-"])
    assert compared.exit_code == 0, compared.output
    assert json.loads(compared.output)["gap_closed"] > 0.9


@pytest.mark.slow
def test_what_no_effect_explains_is_a_table_of_the_twin_beside_the_figures_found(tmp_path):
    def odd(t, x, v, a):
        over_place = 120.0 * np.tanh((x - 0.2) / 0.05)
        return TOOL.force(t, x, v, a) - 80.0 + over_place + 1500.0 * v * np.abs(v) * (x > 0.1)

    path, twin = imported(replace(TOOL, force=odd, duration=30.0), tmp_path)
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
    for _ in range(15):
        damaged = bytearray(whole)
        for place in rng.integers(0, min(len(whole), 6000), 12):
            damaged[place] = int(rng.integers(256))
        path.write_bytes(damaged[: int(rng.integers(100, len(damaged)))])
        report, line = run(path)
        assert report is not None or "damaged.h5" in line


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
