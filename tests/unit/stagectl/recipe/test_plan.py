"""The order of steps: sites, lists of moves, reversals."""

from stagectl.recipe import Dwell, ExposeStep, FiducialStep, MoveStep, Profile, Settle
from stagectl.recipe.plan import plan
from tests.unit.stagectl.recipe.conftest import HEAD

RETRY = HEAD.replace("0.15}", "0.15, on_timeout: retry}")
MACRO, MICRO = Profile(0.5, 3.0, 200.0), Profile(0.01, 0.2, 20.0)
SETTLE = Settle(5e-8, 5e-3, 0.15, "retry")


def test_a_site_is_macro_settle_mark_micro_settle_expose(recipe_of):
    recipe = recipe_of(
        RETRY + "expose: 0.02\nfiducial: {source: simulated, range: 1 um}\nsites: [[0, 0.01]]\n"
    )
    assert plan(recipe) == (
        MoveStep(1, "macro", (0.0, 0.01), MACRO),
        SETTLE,
        FiducialStep(1),
        MoveStep(1, "micro", None, MICRO),
        SETTLE,
        ExposeStep(0.02),
    )


def test_without_marks_and_camera_there_are_macro_moves_only(recipe_of):
    recipe = recipe_of(RETRY + "expose: 0\nfiducial: {source: none}\nsites: [[0, 0], [0, 0.01]]\n")
    assert plan(recipe) == (
        MoveStep(1, "macro", (0.0, 0.0), MACRO),
        SETTLE,
        MoveStep(2, "macro", (0.0, 0.01), MACRO),
        SETTLE,
    )


def test_moves_of_each_kind_take_their_profile_and_own_figures(recipe_of):
    recipe = recipe_of(
        RETRY + "moves:\n- {to: [0.01, 0]}\n- {to: [0.02, 0], kind: micro, velocity: 5 mm/s}\n"
        "- {dwell: 0.1}\n- {to: [0, 0], kind: creep, velocity: 1 mm/s, jerk: 1}\n"
    )
    assert plan(recipe) == (
        MoveStep(None, "macro", (0.01, 0.0), MACRO),
        SETTLE,
        MoveStep(None, "micro", (0.02, 0.0), Profile(0.005, 0.2, 20.0)),
        SETTLE,
        Dwell(0.1),
        MoveStep(None, "creep", (0.0, 0.0), Profile(0.001, 0.2, 1.0)),
    )


def relatives(recipe, start=(0.0, 0.0)):
    return [s.relative for s in plan(recipe, start) if isinstance(s, MoveStep) and s.relative]


def test_reverse_goes_against_the_last_move_of_that_axis(recipe_of):
    recipe = recipe_of(
        RETRY + "moves:\n- {to: [0.01, -0.01]}\n- {reverse: 1.0e-4, axis: x}\n"
        "- {reverse: 2.0e-4, axis: y}\n- {reverse: 1.0e-4, axis: x}\n"
    )
    assert relatives(recipe) == [(-1e-4, 0.0), (0.0, 2e-4), (1e-4, 0.0)]
    # coming from further out, the first move went the other way
    assert relatives(recipe, (0.05, 0.0))[0] == (1e-4, 0.0)


def test_a_first_reverse_goes_in_the_positive_direction_and_repeats_alternate(
    recipe_of,
):
    recipe = recipe_of(
        RETRY + "moves: [{repeat: 2, moves: [{repeat: 2, moves: [{reverse: 10 um, axis: y}]}]}]\n"
    )
    assert relatives(recipe) == [(0.0, 1e-5), (0.0, -1e-5), (0.0, 1e-5), (0.0, -1e-5)]
    assert not any(isinstance(step, Settle) for step in plan(recipe))
