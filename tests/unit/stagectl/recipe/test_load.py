"""Recipe files against a machine: what is read, and that every bad one says where and why."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from stagectl.config import Machine
from stagectl.errors import ConfigError
from stagectl.recipe import Profile, Recipe, load_recipe
from stagectl.recipe.schema import SimulatedMark

Problems = Callable[..., tuple[str, ...]]
RecipeOf = Callable[[str], Recipe]

HEAD = """recipe: a
macro: {velocity: 0.5, acceleration: 3.0, jerk: 200.0}
micro: {velocity: 0.01, acceleration: 0.2, jerk: 20.0}
settle: {window: 50 nm, hold: 5 ms, timeout: 0.15}
"""


def test_the_shipped_recipe(inspection: str, recipe_of: RecipeOf) -> None:
    recipe = recipe_of(inspection)
    assert recipe.name == "inspection-20"
    assert recipe.axes == ("x", "y")
    assert recipe.macro == Profile(0.5, 3.0, 200.0)
    assert recipe.settle.window == 5e-8
    assert recipe.settle.on_timeout == "continue"
    assert recipe.expose == 0.02
    assert recipe.fiducial == SimulatedMark(80e-6, 1)
    assert recipe.text == inspection
    assert len(recipe.sites) == 20
    # serpentine: the second row runs backwards, so neighbours in the visit are one pitch apart
    assert recipe.sites[:6] == (
        (-0.05, -0.05), (-0.025, -0.05), (0.0, -0.05), (0.025, -0.05), (0.05, -0.05),
        (0.05, -0.025),
    )  # fmt: skip
    assert recipe.sites[-1] == (-0.05, 0.025)


def test_units_mean_the_same_as_si_figures(inspection: str, recipe_of: RecipeOf) -> None:
    text = (
        inspection.replace("window: 5.0e-8", "window: 50 nm")
        .replace("velocity: 0.01,", "velocity: 10 mm/s,")
        .replace("range: 80.0e-6", "range: 80 um")
        .replace("timeout: 0.15", "timeout: 150 ms")
        .replace("pitch: [0.025, 0.025]", "pitch: [25 mm, 2.5 cm]")
    )
    one, other = recipe_of(inspection), recipe_of(text)
    assert (one.settle, one.micro, one.fiducial, one.sites) == (
        other.settle, other.micro, other.fiducial, other.sites,
    )  # fmt: skip


def test_optional_keys(inspection: str, recipe_of: RecipeOf) -> None:
    recipe = recipe_of(
        inspection + "lot: 1207\nwafer: W 03\nlimits: {settling: 10 ms, peak_error: 1 um}\n"
    )
    assert (recipe.lot, recipe.wafer) == ("1207", "W 03")
    assert (recipe.limits.settling, recipe.limits.peak_error) == (0.01, 1e-6)


@pytest.mark.parametrize(
    ("old", "new", "key_and_reason"),
    [
        (
            "velocity: 0.5",
            "velocity: ^5 ms",
            "macro.velocity: must be a velocity (SI, or a text such as '10 mm/s'), "
            "but '5 ms' is a time",
        ),
        (
            "velocity: 0.5",
            "velocity: ^1.5",
            "macro.velocity: 1.5 is above the limit of axis x (1), y (1)",
        ),
        ("jerk: 20.0", "jerk: ^20000", "micro.jerk: 20000 is above the limit of axis x (2000)"),
        (
            "acceleration: 3.0",
            "acceleration: ^-3",
            "macro.acceleration: must be > 0, is -3",
        ),
        (
            "acceleration: 3.0",
            "acceleration: ^.nan",
            "macro.acceleration: must be a finite number, is .nan",
        ),
        (
            "velocity: 0.5, acc",
            "velocity: 0.5, ^velocity: 0.4, acc",
            "macro.velocity: duplicate key (first at line 3)",
        ),
        (
            "velocity: 0.5",
            "^velocty: 0.5",
            "macro.velocty: unknown key; did you mean 'velocity'?",
        ),
        (
            "{velocity: 0.5, acceleration: 3.0, jerk: 200.0}",
            "^[0.5, 3.0, 200.0]",
            "macro: must be a mapping (key: value), is a list",
        ),
        ("macro: {", "^macros: {", "macros: unknown key; did you mean 'macro'?"),
        (
            "window: 5.0e-8",
            "window: ^on",
            "settle.window: must be a length (SI, or a text such as '80 um'), is 'on'",
        ),
        (
            "window: 5.0e-8",
            "window: ^1.0e-10",
            "settle.window: is below the encoder increment, 1e-09 m",
        ),
        ("timeout: 0.15", "timeout: ^1 ms", "settle.timeout: is shorter than hold, 0.005 s"),
        (
            "timeout: 0.15",
            "timeout: 0.15, on_timeout: ^shrug",
            "settle.on_timeout: must be 'continue', 'retry' or 'stop', is 'shrug'",
        ),
        ("expose: 0.02", "expose: ^-1", "expose: must be >= 0, is -1"),
        ("grid:", "girds:", "sites: must be {grid: ...}, {file: ...} or a list of pairs [x, y]"),
        (
            "count: [5, 4]",
            "count: [5, ^4.5]",
            "sites.grid.count[2]: must be a whole number, is 4.5",
        ),
        (
            "count: [5, 4]",
            "count: ^[999, 999]",
            "sites.grid.count: more than 100000 sites: 998001",
        ),
        (
            "{origin: [-0.05",
            "^{origin: [-0.16",
            "sites.grid: site 1: -0.16 m is outside the travel -0.15 ... 0.15 m of axis x "
            "(4 sites in all)",
        ),
        (
            "{origin: [-0.05, -0.05]",
            "^{origin: [-0.15, -0.05]",
            "sites.grid: site 1: -0.15 m with its fiducial 8e-05 m away is outside the travel",
        ),
        ("simulated,", "^simulates,", "fiducial.source: must be one of simulated, none, offsets"),
        ("{source: simulated, ", "^{", "fiducial.source: is missing"),
        ("seed: 1", "seed: ^-1", "fiducial.seed: must be >= 0, is -1"),
        (
            "simulated, range: 80.0e-6, seed: 1",
            "plugin, name: ^camera",
            "fiducial.name: no plug-in 'camera' is installed",
        ),
        ("recipe: inspection-20", "recipe: ^20", "recipe: must be a text, is 20"),
    ],
)
def test_each_fault_is_one_line_at_its_place(
    inspection: str, problems_of: Problems, old: str, new: str, key_and_reason: str
) -> None:
    """`^` in the new text marks the place that the problem should name."""
    assert old in inspection
    text = inspection.replace(old, new, 1)
    (found,) = problems_of(text.replace("^", ""))
    if "^" in text:
        before = text[: text.index("^")]
        place = f"{before.count(chr(10)) + 1}:{len(before) - before.rfind(chr(10))}"
        assert found.startswith(f"r.yaml:{place}: {key_and_reason}")
    else:
        assert key_and_reason in found


@pytest.mark.parametrize("key", ["recipe", "macro", "micro", "settle", "expose", "fiducial"])
def test_keys_that_must_be_there(inspection: str, problems_of: Problems, key: str) -> None:
    text = "\n".join(line for line in inspection.splitlines() if not line.startswith(f"{key}:"))
    (found,) = problems_of(text)
    assert found.endswith(f": {key}: is missing")


def test_sites_and_moves_exclude_each_other(inspection: str, problems_of: Problems) -> None:
    (both,) = problems_of(inspection + "moves: [{dwell: 1}]\n")
    assert "moves: cannot be combined with sites" in both
    (neither,) = problems_of(HEAD)
    assert "sites: is missing (or a list of moves instead)" in neither


def test_a_limit_that_judges_nothing_is_noted(recipe_of: RecipeOf, inspection: str) -> None:
    wide = inspection.replace("expose: ", "limits: {peak_error: 1 mm}\nexpose: ")
    (note,) = recipe_of(wide).notes
    assert note.startswith("limits.peak_error: 0.001 m is never exceeded: axis x faults at 0.001 m")


def test_keys_without_effect_are_noted(recipe_of: RecipeOf) -> None:
    recipe = recipe_of(HEAD + "expose: 1\nlimits: {peak_error: 1 um}\nmoves: [{dwell: 1}]\n")
    assert recipe.notes == (
        "expose has no effect with moves", "limits has no effect with moves",
    )  # fmt: skip


def test_a_missing_file_a_directory_and_an_empty_file(tmp_path: Path, machine: Machine) -> None:
    empty = tmp_path / "empty.yaml"
    empty.touch()
    for path, reason in {
        tmp_path / "no.yaml": ": no such file",
        tmp_path: ": is a directory, not a file",
        empty: ":1:1: is empty",
    }.items():
        with pytest.raises(ConfigError) as caught:
            load_recipe(path, machine)
        assert caught.value.problems == (f"{path}{reason}",)


def test_a_name_must_not_be_a_path(problems_of: Problems, inspection: str) -> None:
    text = inspection.replace("recipe: inspection-20", "recipe: ../evil")
    assert problems_of(text) == (
        "r.yaml:2:9: recipe: must not contain a /: folders are named after it",
    )
