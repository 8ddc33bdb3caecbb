"""Recipe files against a machine: what is read, and that every bad one says where and why."""

import pytest

from stagectl.recipe import Profile
from stagectl.recipe.schema import SimulatedMark
from tests.unit.stagectl.changed_text import changed_text
from tests.unit.stagectl.recipe.conftest import HEAD


def test_the_shipped_recipe(inspection, recipe_of):
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


def test_optional_keys(inspection, recipe_of):
    recipe = recipe_of(
        inspection + "lot: 1207\nwafer: W 03\nlimits: {settling: 10 ms, peak_error: 1 um}\n"
    )
    assert (recipe.lot, recipe.wafer) == ("1207", "W 03")
    assert (recipe.limits.settling, recipe.limits.peak_error) == (0.01, 1e-6)


@pytest.mark.parametrize(
    ("new", "key_and_reason"),
    [
        ("velocity: ^1.5", "macro.velocity: 1.5 is above the limit of axis x (1), y (1)"),
        ("micro: {velocity: 0.01, acceleration: 0.2, jerk: ^20000}", "micro.jerk: 20000 is above"),
        ("acceleration: ^-3", "macro.acceleration: must be > 0, is -3"),
        ("macro -> ^macros: {jerk: 200.0}", "macros: unknown key; did you mean 'macro'?"),
        ("window: ^1.0e-10", "settle.window: is below the encoder increment, 1e-09 m"),
        ("timeout: ^1 ms", "settle.timeout: is shorter than hold, 0.005 s"),
        ("timeout: 0.15, on_timeout: ^shrug", "settle.on_timeout: must be 'continue', 'retry' or"),
        ("expose: ^-1", "expose: must be >= 0, is -1"),
        ("grid -> girds: {}", "sites: must be {grid: ...}, {file: ...} or a list of pairs [x, y]"),
        ("count: ^[999, 999]", "sites.grid.count: more than 100000 sites: 998001"),
        (
            "grid: ^{origin: [-0.16, -0.05], pitch: [0.025, 0.025], count: [5, 4]}",
            "sites.grid: site 1: -0.16 m is outside the travel -0.15 ... 0.15 m of axis x (4 sites",
        ),
        (
            "grid: ^{origin: [-0.15, -0.05], pitch: [0.025, 0.025], count: [5, 4]}",
            "sites.grid: site 1: -0.15 m with its fiducial 8e-05 m away is outside the travel",
        ),
        ("source: ^simulates", "fiducial.source: must be one of simulated, none, offsets"),
        ("fiducial: ^{range: 80.0e-6, seed: 1}", "fiducial.source: is missing"),
        ("seed: ^-1", "fiducial.seed: must be >= 0, is -1"),
        ("fiducial: {source: plugin, name: ^camera}", "fiducial.name: no plug-in 'camera' is"),
        ("recipe: ^20", "recipe: must be a text, is 20"),
        ("recipe: ^../evil", "recipe: must not contain a /: folders are named after it"),
        ("window: ^2 m", "settle.window: 2 m is never exceeded: axis x faults at 0.001 m (limits"),
        ("timeout: ^1.0e+9", "settle.timeout: 1e+09 s is longer than the longest move, 3600 s"),
    ],
)
def test_each_fault_is_one_line_at_its_place(inspection, problems_of, new, key_and_reason):
    text, place = changed_text(inspection, new)
    (found,) = problems_of(text)
    assert found.startswith(f"r.yaml:{place}: {key_and_reason}" if place else "r.yaml:")
    assert key_and_reason in found


@pytest.mark.parametrize("key", ["recipe", "macro", "micro", "settle", "expose", "fiducial"])
def test_keys_that_must_be_there(inspection, problems_of, key):
    text = "\n".join(line for line in inspection.splitlines() if not line.startswith(f"{key}:"))
    (found,) = problems_of(text)
    assert found.endswith(f": {key}: is missing")


def test_sites_and_moves_exclude_each_other(inspection, problems_of):
    (both,) = problems_of(inspection + "moves: [{dwell: 1}]\n")
    assert "moves: cannot be combined with sites" in both
    (neither,) = problems_of(HEAD)
    assert "sites: is missing (or a list of moves instead)" in neither


def test_a_limit_that_judges_nothing_is_noted(recipe_of, inspection):
    wide = inspection.replace("expose: ", "limits: {peak_error: 1 mm}\nexpose: ")
    (note,) = recipe_of(wide).notes
    assert note.startswith("limits.peak_error: 0.001 m is never exceeded: axis x faults at 0.001 m")


def test_keys_without_effect_are_noted(recipe_of):
    recipe = recipe_of(HEAD + "expose: 1\nlimits: {peak_error: 1 um}\nmoves: [{dwell: 1}]\n")
    assert recipe.notes == (
        "expose has no effect with moves", "limits has no effect with moves",
    )  # fmt: skip
