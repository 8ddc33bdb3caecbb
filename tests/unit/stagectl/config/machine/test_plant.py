"""Friction of a machine file as simulator and estimator take it."""

from stagectl.config import load_machine, parse_machine


def test_the_attraction_becomes_a_rate_of_the_coulomb_force() -> None:
    friction = load_machine().axes["x"].plant.friction
    figures = friction.figures
    assert (figures.law, figures.elements) == ("gms", friction.elements)
    assert figures.relaxation_rate * friction.coulomb == friction.attraction
    assert (figures.stiffness, figures.viscous) == (friction.stiffness, friction.viscous)


def test_a_law_without_presliding_has_none_of_its_figures() -> None:
    lines = load_machine().text.splitlines()
    first = next(i for i, line in enumerate(lines) if line.strip() == "friction:")
    gone = ("elements:", "stiffness:", "attraction:")
    own = [
        line.replace("model: gms", "model: coulomb")
        for line in lines[first : first + 12]
        if not line.strip().startswith(gone)
    ]
    text = "\n".join([*lines[:first], *own, *lines[first + 12 :]])
    figures = parse_machine(text, "m").axes["x"].plant.friction.figures
    assert figures.law == "coulomb"
    assert (figures.elements, figures.stiffness, figures.relaxation_rate) == (0, 0.0, 0.0)
