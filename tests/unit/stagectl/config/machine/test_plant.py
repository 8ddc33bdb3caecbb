"""Friction of a machine file as simulator and estimator take it."""

from stagectl.config import load_machine


def test_the_attraction_becomes_a_rate_of_the_coulomb_force() -> None:
    friction = load_machine().axes["x"].plant.friction
    figures = friction.figures
    assert (figures.law, figures.elements) == ("gms", friction.elements)
    assert figures.relaxation_rate * friction.coulomb == friction.attraction
    assert (figures.stiffness, figures.viscous) == (friction.stiffness, friction.viscous)
