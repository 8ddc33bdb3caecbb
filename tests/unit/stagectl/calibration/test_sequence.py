"""The sequence of moves at a site."""

import math

import pytest

from stagectl.calibration import DueSection, load_calibration
from stagectl.calibration.sequence import GOALS, choose_sequence
from stagectl.config import parse_machine
from tests.simple_law import simple_law_text
from tests.unit.stagectl.calibration.conftest import FILE

DUE = DueSection(days=10, moves=100, distance=5.0)


def test_the_sequence_reaches_its_goals(machine, tmp_path):
    path = tmp_path / "sites.yaml"
    path.write_text(FILE + "due: {days: 10, moves: 100, distance: 5.0}\n")
    calibration = load_calibration(path, machine)
    assert calibration.due == DUE
    assert calibration.recipe.excursions == calibration.sequence.excursions
    sequence = calibration.sequence
    assert sequence.reaches()
    assert sequence.duration < 2.0
    for gains in sequence.gains.values():
        for name, goal in GOALS.items():
            assert 0.0 < gains[name].after <= goal < gains[name].before
            assert gains[name].bits == pytest.approx(
                math.log2(gains[name].before / gains[name].after)
            )
    kinds = {e.kind for e in sequence.excursions}
    assert {"other", "micro", "creep"} <= kinds
    offsets = [e.offset[0] for e in sequence.excursions]
    assert min(offsets) < 0 < max(offsets)
    assert offsets[-1] == 0.0


def test_without_presliding_the_sequence_slides_only():
    chosen = choose_sequence(parse_machine(simple_law_text(), "m.yaml"))
    assert chosen.reaches()
    assert {e.kind for e in chosen.excursions} == {"other"}
    assert all(set(gains) == {"coulomb", "viscous"} for gains in chosen.gains.values())
