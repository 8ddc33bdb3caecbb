"""Machine files whose values are inconsistent, or do not fit CiA 402 integers."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from stagectl.config import load_machine, parse_machine
from tests.simple_law import OF_PRESLIDING, simple_law_text

GOOD = load_machine().text
ProblemsOf = Callable[[str], tuple[str, ...]]


@pytest.mark.parametrize(
    ("new", "key_and_reason"),
    [
        ("node: ^127", ".node: 127 is the host's own node id"),
        ("node: 2", "axes.y.node: 2 is the node of axis x already"),
        ("travel: ^[0.15, -0.15]", ".travel: must be [lowest, highest], is [0.15, -0.15]"),
        (
            "travel: ^[-150, 150]",
            ".travel: beyond +-2.147 m, the range of a position in 1 nm (drive.position_unit)",
        ),
        (
            "control_period: ^3.0e-4",
            ".drive.control_period: must divide bus.sync_period (0.001 s), is 0.0003 s",
        ),
        ("control_period: 2.0e-4", "axes.y.drive.control_period: must be the same on all axes"),
        ("peak_force: ^12.0", ".drive.peak_force: must be at least rated_force"),
        (
            "acceleration: ^1.0e+30",
            ".limits.acceleration: beyond 4295 m/s^2, the range of 1 um/s^2 steps "
            "(drive.acceleration_unit)",
        ),
        (
            "following_error: ^4.2949672950",
            ".limits.following_error: beyond 4.295 m, the range of 1 nm steps "
            "(drive.position_unit)",
        ),
        (
            "following_error: ^1.0e-12",
            ".limits.following_error: 1e-12 m is nothing in 1 nm steps (drive.position_unit)",
        ),
        (
            "node: 1\n    homing: {velocity: 0.01, index_velocity: ^1.0e-10}",
            ".homing.index_velocity: 1e-10 m/s is nothing in 1 nm/s steps (drive.position_unit)",
        ),
        (
            "node: 1\n    homing: {velocity: ^1.0e-8}",
            ".homing.velocity: at 1e-08 m/s the travel there and back takes 694 days",
        ),
    ],
)
def test_inconsistent_values_are_one_line_at_their_place(
    check_refused, new: str, key_and_reason: str
) -> None:
    check_refused(new, key_and_reason)


def test_the_simple_law_has_no_figures_of_presliding() -> None:
    x = parse_machine(simple_law_text(), "m.yaml").axes["x"]
    figures = x.plant.friction.figures
    assert (figures.law, figures.coulomb, figures.static_ratio) == ("coulomb", 6.0, 0.4)
    assert (figures.elements, figures.stiffness, figures.attraction) == (0, 0.0, 0.0)


@pytest.mark.parametrize("key", OF_PRESLIDING)
def test_a_figure_that_the_law_does_not_have_is_refused(key: str, problems_of: ProblemsOf) -> None:
    x, y = problems_of(simple_law_text(key))
    assert x.endswith(f"axes.x.plant.friction.{key}: the law coulomb has no such figure")
    assert y.endswith(f"axes.y.plant.friction.{key}: the law coulomb has no such figure")


@pytest.mark.parametrize("key", OF_PRESLIDING)
def test_a_figure_of_the_law_has_to_be_there(key: str, problems_of: ProblemsOf) -> None:
    lines = simple_law_text(*(set(OF_PRESLIDING) - {key})).replace("model: coulomb", "model: gms")
    x, y = problems_of(lines)
    assert x.endswith(f"axes.x.plant.friction.{key}: is missing")
    assert y.endswith(f"axes.y.plant.friction.{key}: is missing")
