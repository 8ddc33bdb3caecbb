"""Machine files with the simple friction law: runs, and what needs presliding."""

import json

import pytest

from stagectl.config import load_machine
from tests.short_recipe import short_recipe
from tests.simple_law import simple_law_text

SITES = ((-0.02, 0.01), (0.03, -0.02), (0.0, 0.03), (-0.03, -0.03), (0.02, 0.02))


@pytest.fixture(scope="module")
def simple(tmp_path_factory):
    """The packaged machine with the law coulomb, as a file."""
    path = tmp_path_factory.mktemp("machine") / "simple.yaml"
    path.write_text(simple_law_text())
    return path


@pytest.fixture
def recipe(tmp_path):
    path = tmp_path / "short.yaml"
    path.write_text(short_recipe(*SITES))
    return path


def test_a_run_learns_the_figures_of_its_law(stagectl, simple, recipe, tmp_path):
    done = stagectl(
        "run", recipe, "--machine", simple, "--simulate", simple, "--friction-scale", "0.5",
        "--out", tmp_path / "run",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["outcome"] == "completed"
    true = load_machine().axes
    for axis in ("x", "y"):
        accepted = [e for e in summary["friction"] if e["axis"] == axis and e["accepted"]]
        last = accepted[-1]["parameters"]
        assert set(last) == set(accepted[-1]["gain"]) == {"coulomb", "viscous"}
        for name, share in (("coulomb", 0.05), ("viscous", 0.1)):
            assert last[name]["value"] == pytest.approx(
                getattr(true[axis].plant.friction, name), rel=share
            )
    page = (tmp_path / "run" / "report.html").read_text()
    assert "coulomb" in page
    assert ">stiffness<" not in page


def test_what_needs_presliding_says_so_in_one_line(stagectl, simple, recipe, tmp_path):
    out = tmp_path / "run"
    done = stagectl("run", recipe, "--machine", simple, "--simulate", simple, "--out", out)
    assert done.returncode == 0, done.stderr
    recording = out / "recording.h5"
    for arguments in (
        ("gap", "diagnose", recording),
        ("gap", "blind", "--trials", "1", "--machine", simple),
        ("identify", recording),
    ):
        refused = stagectl(*arguments)
        assert refused.returncode == 2
        (line,) = refused.stderr.splitlines()
        assert "plant.friction.model: " in line
        assert line.endswith("is coulomb")
    measured = stagectl("gap", "measure", recording)
    assert measured.returncode == 0, measured.stderr
