"""Verdicts follow from figures."""

from dataclasses import replace

import pytest

from stagectl.paper import claims, published
from stagectl.paper.fit import Fit
from stagectl.paper.published import PARAMETERS

FIXED = "reproduced only if zone A's initial force does not follow Fc"


def fit(off, sigma=0.01, mse=1e-8, iterations=(3,), evaluations=(20,)):
    value = {name: published.REFERENCE[name] * (1 + off) for name in PARAMETERS}
    windows = ((0, 400),) if len(evaluations) == 1 else ((0, 300), (300, 400))
    sigmas = dict.fromkeys(PARAMETERS, sigma)
    return Fit(value, sigmas, mse, iterations, evaluations, windows, None)


def both(one, two):
    return {
        "one_window": dict.fromkeys(("logged", "aligned"), one),
        "two_windows": dict.fromkeys(("logged", "aligned"), two),
    }


def test_the_papers_own_outcome_would_be_reproduced():
    one = fit(0.05, 0.03, 3.5e-7, (13,), (78,))
    two = fit(-0.02, 0.01, 1.7e-7, (3, 4), (15, 12))
    for judged in (claims.nearer, claims.residual, claims.evaluations):
        assert judged(both(one, two))[0] == "reproduced"


def test_the_opposite_would_not():
    one = fit(0.01, 0.01, 1e-8, (3,), (20,))
    two = fit(0.05, 0.02, 2e-8, (3, 4), (15, 12))
    for judged in (claims.nearer, claims.residual, claims.evaluations):
        assert judged(both(one, two))[0] == "not reproduced"


def test_what_holds_for_one_alignment_names_it():
    tables = both(fit(0.05, mse=4e-7), fit(0.06, mse=4e-7, evaluations=(9, 5)))
    tables["two_windows"]["logged"] = fit(0.01, 0.005, 1e-7, (2, 2), (9, 5))
    for judged in (claims.nearer, claims.residual):
        assert judged(tables)[0] == "reproduced only if the force is taken as logged"


@pytest.mark.parametrize(
    ("one", "two"),
    [(fit(0.0100), fit(0.0098, 0.001)), (fit(0.05, 0.01), fit(0.01, 0.02))],
    ids=["a tie", "nearer but less sure"],
)
def test_what_is_not_nearer(one, two):
    assert claims.nearer(both(one, two))[0] == "not reproduced"


NEARER = (fit(0.5, 0.5, 1e-2, (13,), (78,)), fit(0.01, 0.01, 1e-8, (3, 4), (15, 12)))
EQUAL = (fit(0.01, 0.01, 1e-8, (3,), (20,)), fit(0.01, 0.01, 1e-8, (3, 2), (15, 5)))


@pytest.mark.parametrize(
    ("holding", "verdict"),
    [
        ((), "not reproduced"),
        (("bounded", "shortened"), "reproduced only if zone A's initial force does not follow Fc"),
        (("shortened",), "reproduced only if zone A's initial force does not follow Fc, and a step "
         "that would leave the bounds is shortened as a whole"),
    ],
)  # fmt: skip
def test_what_holds_with_the_force_fixed_names_that_as_the_condition(holding, verdict):
    fixed = {
        (bounds, initial): both(*(NEARER if bounds in holding else EQUAL))
        for bounds in ("bounded", "shortened")
        for initial in ("reference", "measured")
    }
    for judged in (claims.nearer, claims.residual, claims.evaluations):
        assert claims.under_fixed_force(judged, both(*EQUAL), fixed)[0] == verdict
        # What holds anyway needs no condition.
        assert claims.under_fixed_force(judged, both(*NEARER), fixed)[0] == "reproduced"


def test_what_holds_with_one_fixed_force_only_names_it():
    fixed = {("bounded", "reference"): both(*EQUAL), ("bounded", "measured"): both(*NEARER)}
    verdict, _ = claims.under_fixed_force(claims.residual, both(*EQUAL), fixed)
    assert verdict.startswith("reproduced only if zone A begins at the measured u - m a")


@pytest.mark.parametrize(
    ("number", "verdict"),
    [*((number, f"{FIXED}, and a step that would leave the bounds") for number in (1, 2, 3)),
     (4, "reproduced only if C is held"),
     (5, "reproduced only if zone B begins late"), (6, "reproduced only if zone B takes")],
)  # fmt: skip
def test_verdicts_of_the_base_case(quick, number, verdict):
    assert len(quick.claims) == 6
    assert quick.claims[number - 1].verdict.startswith(verdict)


def test_estimated_initial_force_makes_sigma0_robust(quick):
    """Then nothing of the sixth claim's second half is left."""
    assert claims.robust(replace(quick.case, initial="free"))[0] == "not reproduced"
