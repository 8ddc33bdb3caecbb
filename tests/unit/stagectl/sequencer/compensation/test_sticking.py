"""An axis that turns out to stick is observed by another design, from then on."""

import numpy as np

from estimation.observer import without_presliding
from stagectl.config.settings.observer import design_observers
from stagectl.sequencer.compensation.sticking import Sticking

STUCK = (np.zeros(40), np.linspace(0.0, 20.0, 40), np.ones(40, np.bool_))


def test_before_an_observer_is_on_nothing_is_watched():
    sticking = Sticking()
    assert not sticking.watches
    sticking.judge(*STUCK)
    assert not sticking.found


def test_it_is_found_once(machine):
    design, used = design_observers(machine)["x"], []
    sticking = Sticking()
    sticking.watch(design, used.append)
    sticking.judge(np.linspace(0.0, 3e-5, 40), *STUCK[1:])
    assert sticking.watches
    assert used == []
    sticking.judge(*STUCK)
    assert sticking.found
    assert not sticking.watches
    assert used == [without_presliding(design)]


def test_a_design_without_presliding_is_left_as_it_is(machine):
    sticking = Sticking()
    sticking.watch(without_presliding(design_observers(machine)["x"]), lambda _: None)
    assert not sticking.watches
