"""Machine files whose values are inconsistent, or do not fit CiA 402 integers."""

import pytest

from stagectl.config import load_machine, parse_machine
from tests.simple_law import OF_PRESLIDING, simple_law_text


@pytest.mark.parametrize(
    ("new", "key_and_reason"),
    [
        ("node: ^127", ".node: 127 is the host's own node id"),
        ("node: 2", "axes.y.node: 2 is the node of axis x already"),
        ("travel: ^[0.15, -0.15]", ".travel: must be [lowest, highest], is [0.15, -0.15]"),
        ("travel: ^[-150, 150]", ".travel: beyond +-2.147 m, the range of a position in 1 nm"),
        ("control_period: ^3.0e-4", ".drive.control_period: must divide bus.sync_period (0.001 s)"),
        ("control_period: 2.0e-4", "axes.y.drive.control_period: must be the same on all axes"),
        ("peak_force: ^12.0", ".drive.peak_force: must be at least rated_force"),
        (
            "acceleration: ^1.0e+30",
            ".limits.acceleration: beyond 4295 m/s^2, the range of 1 um/s^2",
        ),
        ("following_error: ^4.2949672950", ".limits.following_error: beyond 4.295 m, the range of"),
        ("following_error: ^1.0e-12", ".limits.following_error: 1e-12 m is nothing in 1 nm steps"),
        ("homing: {index_velocity: ^1.0e-10}", ".homing.index_velocity: 1e-10 m/s is nothing in"),
        ("homing: {velocity: ^1.0e-8}", ".homing.velocity: at 1e-08 m/s the travel there and back"),
    ],
)
def test_inconsistent_values_are_one_line_at_their_place(check_refused, new, key_and_reason):
    check_refused(new, key_and_reason)


TURNING = load_machine().text.replace("node: 1", "node: 1\n    rotary: true", 1)


def test_an_axis_that_turns_counts_in_a_unit_that_its_travel_fits_in():
    text = TURNING.replace("velocity: 1.0,", "velocity: 3.0,", 1)
    text = text.replace("[-0.15, 0.15]", "[-628.3, 628.3]", 1)
    x, y = parse_machine(text, "m.yaml").axes.values()
    assert (x.drive.position_unit, y.drive.position_unit) == (pytest.approx(1e-6), 1e-9)
    assert parse_machine(TURNING, "m.yaml").axes["x"].drive.position_unit == 1e-9


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        (
            "rated_force: 40.0",
            "position_unit: 1 nm\n      rated_force: 40.0",
            "travel: beyond +-2.147 rad, the range of a position in 1 nrad (drive.position_unit)",
        ),
        (
            "mass: 8.0",
            "mass: 1.0e+30",
            "plant.mass: must be at most 1e+09 kg m², is 1e+30",
        ),
        ("coulomb: 6.0", "coulomb: 90.0", "takes 126 N m; the drive has 120 N m at most"),
        ("noise: 1.0e-9", "noise: 1.0", "1 rad must be below limits.following_error, 0.001 rad"),
        (
            "rotary: true",
            "rotary: true\n    effects: [{effect: force_offset}]",
            "force is missing (force against positive motion [N m])",
        ),
    ],
)
def test_texts_about_an_axis_that_turns_have_its_units(problems_of, old, new, reason):
    (line,) = problems_of(TURNING.replace("[-0.15, 0.15]", "[-3.2, 3.2]", 1).replace(old, new, 1))
    assert reason in line


def test_the_simple_law_has_no_figures_of_presliding():
    x = parse_machine(simple_law_text(), "m.yaml").axes["x"]
    figures = x.plant.friction.figures
    assert (figures.law, figures.coulomb, figures.static_ratio) == ("coulomb", 6.0, 0.4)
    assert (figures.elements, figures.stiffness, figures.attraction) == (0, 0.0, 0.0)


@pytest.mark.parametrize("key", OF_PRESLIDING)
def test_each_law_has_its_figures_and_no_others(key, problems_of):
    others = simple_law_text(*(set(OF_PRESLIDING) - {key})).replace("model: coulomb", "model: gms")
    for text, reason in (
        (simple_law_text(key), "the law coulomb has no such figure"),
        (others, "is missing"),
    ):
        for name, found in zip("xy", problems_of(text), strict=True):
            assert found.endswith(f"axes.{name}.plant.friction.{key}: {reason}")
