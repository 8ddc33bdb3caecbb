"""`stagectl identify`: what it recommends for the machine file."""

import re
from dataclasses import replace

import pytest

from estimation.offline import Figure, Identification
from estimation.offline.held_out import BETTER, NO_BETTER, UNTESTED, WORSE
from estimation.offline.uncertainty import ESTIMATED
from stagectl.cli.identify import _for_machine_file, _machine_values

NAMES = (
    "coulomb", "viscous", "stiffness", "relaxation_rate", "static_ratio", "stribeck_velocity",
    "stribeck_shape",
)  # fmt: skip


def answer(held_out, recommended):
    of = ("", 10.0, 4.0, 12.0, 0.1, 40.0, ESTIMATED)
    figures = tuple(Figure(name, *of, held_out.get(name, BETTER)) for name in NAMES)
    return Identification(None, figures, 1.0, 3.0, 1.1, 9000, 20, recommended)


def test_only_what_is_recommended_is_for_the_machine_file():
    found = answer({"coulomb": WORSE, "viscous": NO_BETTER}, {"stiffness": 12.0})
    assert _machine_values(found) == {"stiffness": 12.0}
    text = "\n".join(_for_machine_file(found))
    assert "For the machine file:\n    stiffness: 12" in text
    assert "better with the prior: coulomb" in text
    assert "as well with the prior: viscous" in text
    assert all(len(line) <= 80 for line in text.splitlines())


def test_nothing_recommended_says_so_and_why():
    worse = _for_machine_file(answer(dict.fromkeys(NAMES, WORSE), {}))
    assert worse[0] == "  No value is worth changing."
    assert worse[1].startswith("  Held-out moves are predicted better with the prior: coulomb")
    untested = "\n".join(_for_machine_file(answer(dict.fromkeys(NAMES, UNTESTED), {})))
    assert "too few moves to hold any out: coulomb" in untested
    apart = re.sub(r"\s+", " ", "\n".join(_for_machine_file(answer({}, {}))))
    assert "Each alone predicts held-out moves better, all together do not: coulomb" in apart


@pytest.mark.parametrize(
    ("recommended", "attraction"),
    [({"coulomb": 12.0}, 120.0), ({"relaxation_rate": 13.0}, 130.0),
     ({"coulomb": 12.0, "relaxation_rate": 13.0}, 156.0), ({"viscous": 11.0}, None)],
)  # fmt: skip
def test_the_machine_files_c_follows_fc_and_the_rate(recommended, attraction):
    found = replace(answer({}, {}), recommended=recommended)
    assert _machine_values(found).get("attraction") == attraction
