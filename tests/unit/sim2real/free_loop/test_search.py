"""Effects found in the free loop, on stages that the machine file describes badly."""

from __future__ import annotations

import numpy as np
import pytest

from hil_sim.effects.library import library
from sim2real.fitting import NUISANCES, AxisModel, Term
from sim2real.free_loop import FreeLoop, fit_figures, search_free
from sim2real.free_loop.search import is_certain
from sim2real.gap import compare_with_model
from tests.unit.sim2real.conftest import TOLERANCE, Nominal, stage_with

Stage = Nominal


def loop_of(recording, settings, axis="x"):
    measured = compare_with_model(recording, settings, 2)
    return FreeLoop(axis, [measured], settings, TOLERANCE[axis])


THREE: dict[str, dict[str, float]] = {
    "viscous_asymmetry": {"ratio": 0.3},
    "transmission_ripple": {"amplitude": 1.0, "pitch": 5e-3, "phase": 1.0},
    "force_offset": {"force": 1.2},
}


@pytest.fixture(scope="module")
def screw(nominal):
    return loop_of(stage_with(nominal, 31, x=THREE), nominal[1])


def test_three_effects_are_found_with_their_figures(screw):
    known = library()
    names = (*THREE, "payload_mass", "friction_asymmetry", "cogging")
    found = search_free(screw, {name: known[name] for name in names})
    assert set(found.best.model.names()) == set(THREE)
    assert found.names_causes()
    assert found.closed > 0.95
    values = {term.name: term.mapping() for term in found.best.model.terms}
    assert values["transmission_ripple"]["pitch"] == pytest.approx(5e-3, rel=3e-3)
    assert values["transmission_ripple"]["amplitude"] == pytest.approx(1.0, abs=0.15)
    assert values["force_offset"]["force"] == pytest.approx(1.2, abs=0.2)
    closed = [step.closed for step in found.steps]
    assert closed == sorted(closed)
    for name in THREE:
        probability, _ = found.probability(name)
        assert 0.5 < probability <= 1.0


def test_what_the_right_model_leaves_is_the_floor(screw):
    known = library()
    right = AxisModel(
        np.zeros(NUISANCES),
        tuple(Term(known[name], tuple(values.values())) for name, values in THREE.items()),
    )
    assert screw.gap(screw.residual(screw.start)) > 50.0
    assert screw.gap(screw.residual(right)) < 8.0


def test_figures_of_an_incomplete_model_are_those_that_close_the_loop(screw):
    """Each half of the moves gives its own, and none of them opens the other half."""
    start = screw.start.added(Term(library()["force_offset"], (0.3,)))
    fitted, folds = fit_figures(screw, start)
    assert screw.gap(fitted.residual) < screw.gap(screw.residual(start))
    assert fitted.model.terms[0].values[0] == pytest.approx(1.2, abs=0.5)
    assert len({fold.model.terms[0].values for fold in folds}) == len(folds)
    for fold in folds:
        assert screw.gap(fold.residual) < screw.gap(screw.residual(screw.start))


def test_effects_found_otherwise_are_the_result_where_they_score_better(screw):
    known = library()
    right = screw.start
    for name, values in THREE.items():
        right = right.added(Term(known[name], tuple(values.values())))
    few = {"force_offset": known["force_offset"]}
    found = search_free(screw, few, rival=right)
    assert set(found.best.model.names()) == set(THREE)
    assert found.names_causes()
    assert [set(step.added) for step in found.steps] == [set(THREE)]
    worse = search_free(screw, few, rival=screw.start.added(Term(known["payload_mass"], (0.1,))))
    assert worse.best.model.names() == ("force_offset",)


def test_no_more_effects_are_sought_than_asked_for(screw):
    known = library()
    found = search_free(screw, {name: known[name] for name in THREE}, most=2)
    assert len(found.best.model.terms) == 2


def test_a_search_ends_before_an_effect_that_something_else_beats(screw):
    known = library()
    asked = []

    def is_beaten(before, after):
        asked.append((before.names(), after.names()))
        return True

    sought, rival = {name: known[name] for name in THREE}, screw.start
    for name, values in THREE.items():
        rival = rival.added(Term(known[name], tuple(values.values())))
    found = search_free(screw, sought, rival=rival, is_beaten=is_beaten)
    first = found.best.model.names()
    assert len(first) == 1
    assert [before for before, _ in asked] == [first, first], "a rival is asked about, too"
    assert asked[-1][1] == rival.names()


def test_a_force_that_is_known_is_part_of_every_model(screw, nominal):
    (measured,) = screw.measured
    force = np.full(len(measured.replay.demand), THREE["force_offset"]["force"])
    beside = FreeLoop("x", [measured], nominal[1], TOLERANCE["x"], known=[force])
    offset = screw.start.added(Term(library()["force_offset"], (1.2,)))
    np.testing.assert_allclose(
        beside.residual(beside.start), screw.residual(offset), atol=0.05, rtol=1e-3
    )
    mass = screw.start.added(Term(library()["payload_mass"], (0.2,)))
    both = mass.added(offset.terms[0])
    np.testing.assert_allclose(beside.residual(mass), screw.residual(both), atol=0.05, rtol=1e-3)


def test_values_that_are_not_physical_have_no_residual(screw):
    impossible = screw.start.added(Term(library()["payload_mass"], (-100.0,)))
    (left, plain) = screw.residuals([impossible, screw.start])
    assert left is None
    assert plain is not None
    with pytest.raises(ValueError, match="axis x"):
        screw.residual(impossible)


def test_names_are_not_given_where_much_is_left(nominal):
    wave = {"amplitude": 2.0, "pitch": 0.03, "phase": 0.5}
    recording = stage_with(nominal, 32, x={"cogging": wave})
    others = ("viscous_asymmetry", "cable_stiffness", "payload_mass")
    known = library()
    found = search_free(loop_of(recording, nominal[1]), {name: known[name] for name in others})
    assert not found.names_causes()


def test_a_model_without_mass_cannot_be_simulated(screw):
    """Effects may add up to one, though each is possible: the search passes over it."""
    lighter = Term(library()["payload_mass"], (-0.6 * screw.axis.mass,))
    assert screw.allows(screw.start.added(lighter))
    without = screw.start.added(lighter).added(lighter)
    assert not screw.allows(without)
    with pytest.raises(ValueError, match="not physical"):
        fit_figures(screw, without)


@pytest.mark.parametrize(
    ("change", "certain"),
    [
        ([3.0, 2.0, 4.0, 3.0, 2.0, 3.0, 4.0, 2.0], True),
        ([40.0, 20.0, 9.0, 4.0, 2.0, 1.0, 0.5, 0.2, -0.1], True),  # it fades
        ([40.0, -20.0, 9.0, -14.0, 2.0, -1.0, 0.5, 0.2], False),
        ([40.0, -3.0, -2.0, -4.0, -3.0, -5.0, -2.0, -1.0], False),  # one move against all others
        ([3.0, 2.0, 1.0, 2.0], True),
        ([3.0, 2.0, -1.0, 2.0], False),  # too few moves
        ([4.4, 5.2, -0.1, 4.1, 2.7], True),  # few, but alike
    ],
)
def test_a_step_counts_where_chance_would_hardly_do_as_well(change, certain):
    assert is_certain(np.array(change)) is certain
