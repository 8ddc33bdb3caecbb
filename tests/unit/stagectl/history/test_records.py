"""Rows of the history: what they check, and what identity they have."""

from dataclasses import replace

import pytest

from stagectl.history import RunEntry, StageKey


def test_a_covariance_that_does_not_fit_its_figures_is_refused(an_estimate):
    with pytest.raises(ValueError, match="covariance: 3 entries for 2 figures"):
        an_estimate(1, covariance=(0.04, 0.01, 0.25))


def test_a_sigma_is_the_root_of_its_place_on_the_diagonal(an_estimate):
    assert an_estimate(1).sigma("coulomb") == pytest.approx(0.2)
    assert an_estimate(1).sigma("viscous") == pytest.approx(0.5)
    assert an_estimate(1, covariance=(-1e-18, 0.0, 0.0, 0.25)).sigma("coulomb") == 0.0  # rounding
    with pytest.raises(ValueError, match="stiffness"):
        an_estimate(1).sigma("stiffness")


def test_simulated_and_real_stages_of_a_name_are_two():
    assert StageKey("wafer-xy", True) != StageKey("wafer-xy", False)
    assert str(StageKey("wafer-xy", True)) == "wafer-xy (simulated)"
    assert str(StageKey("wafer-xy", False)) == "wafer-xy"


def test_what_only_a_run_knows_of_itself_does_not_make_its_row_another(an_estimate):
    entry = RunEntry(StageKey("m", False), ("x",), 0.0, "r", None, None, "stagectl 0.1", "f")
    assert replace(entry, uuid="a", operator="me", comment="c") == entry
    assert replace(entry, wafer="W1") != entry
    assert an_estimate(1, number=7) == an_estimate(1)
