"""Effects as users meet them: listed, in machine files, in runs and in the gap."""

import json
from pathlib import Path

import pytest

from stagectl.config import load_machine
from tests.short_recipe import short_recipe

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "sim-to-real.md"
RECIPE = short_recipe((0.0, 0.0), (0.01, 0.0), (0.01, 0.01), (0.0, 0.01))
EFFECTS = """\
    effects:
      - {effect: cogging, amplitude: 1.5, pitch: 0.03, phase: 1}
      - {effect: current_bandwidth, bandwidth: 200}
      - {effect: thermal_drift, amplitude: 0.3, time_constant: 1.5}
"""


def with_effects(lines):
    return load_machine().text.replace("    node: 2\n", f"    node: 2\n{lines}", 1)


def test_the_page_holds_the_table_that_the_command_prints(stagectl):
    done = stagectl("effects", "--markdown")
    page = PAGE.read_text(encoding="utf-8")
    table = page.partition("<!-- effects -->\n")[2].partition("<!-- /effects -->")[0]
    assert done.stdout == table
    assert table.count("\n") >= 2 + 21


def test_an_effect_is_described(stagectl):
    done = stagectl("effects", "base_motion", "--json", "-")
    (effect,) = json.loads(done.stdout)
    assert [p["key"] for p in effect["parameters"]] == ["frequency", "damping", "mass_ratio"]
    assert effect["parameters"][0]["usual"] == [5.0, 30.0]
    words = stagectl("effects", "base_motion").stdout
    assert "isolators" in words
    assert effect["remedy"][:20] in words
    missing = stagectl("effects", "base_moton")
    assert missing.returncode == 2
    assert "did you mean 'base_motion'?" in missing.stderr


def test_a_run_with_effects_and_its_gap(stagectl, tmp_path):
    truth, recipe = tmp_path / "truth.yaml", tmp_path / "short.yaml"
    truth.write_text(with_effects(EFFECTS))
    recipe.write_text(RECIPE)
    out = tmp_path / "run"
    done = stagectl("run", recipe, "--simulate", truth, "--compensation", "model", "--out", out)
    assert done.returncode == 0, done.stderr

    def gap(*options):
        done = stagectl("gap", "measure", out / "recording.h5", "--json", "-", *options)
        assert done.returncode == 0, done.stderr
        found = json.loads(done.stdout)["gap"]
        return {(a, s): found[a][s]["nominal"] for a in "xy" for s in ("position", "force")}

    nominal, declared = gap(), gap("--machine", truth)
    assert declared["y", "position"] < 0.3 * nominal["y", "position"]
    assert declared["y", "force"] < 0.3 * nominal["y", "force"]
    assert declared["x", "position"] == nominal["x", "position"]


@pytest.mark.parametrize("command", [("gap", "measure"), ("run",)])
def test_a_bad_effect_is_one_line(stagectl, tmp_path, command):
    path = tmp_path / "m.yaml"
    path.write_text(with_effects("    effects: [{effect: cogging, amplitud: 1}]\n"))
    recipe = tmp_path / "short.yaml"
    recipe.write_text(RECIPE)
    data = ROOT / "tests" / "data" / "null-2.h5"
    options = [recipe, "--simulate", path] if command == ("run",) else [data, "--machine", path]
    done = stagectl(*command, *options, cwd=tmp_path)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert "m.yaml:" in line
    assert "axes.y.effects[1].amplitud: unknown key of cogging; did you mean 'amplitude'?" in line
