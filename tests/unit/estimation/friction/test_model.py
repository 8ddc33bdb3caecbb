"""Laws by name, and the state of an axis' friction."""

from typing import get_args

import numpy as np
import pytest

from estimation.friction import FrictionState
from estimation.friction.model import (
    LAWS,
    breakaway_travel,
    count_states,
    kernel_figures,
)
from stagedata import FrictionFigures, LawName

GMS = FrictionFigures(10, 6.0, 20.0, 6e5, 100.0, 0.4, 2e-3, 1.0)
COULOMB = FrictionFigures(0, 6.0, 20.0, 0.0, 0.0, 0.4, 2e-3, 1.0, "coulomb")


def test_every_law_of_a_machine_file_has_its_module():
    assert set(LAWS) == set(get_args(LawName))


def test_a_travel_to_break_away_takes_presliding():
    assert (count_states(GMS), count_states(COULOMB)) == (10, 1)
    assert breakaway_travel(COULOMB) == 0.0
    # the last element breaks away where its share of Fs meets its spring; they share sigma0
    assert breakaway_travel(GMS) > GMS.coulomb * (1.0 + GMS.static_ratio) / GMS.stiffness


def test_what_is_kept_of_a_relaxation_falls_with_the_period():
    short, long = (kernel_figures(GMS, period) for period in (1e-4, 1e-2))
    assert 0.0 < long.retained < short.retained < 1.0
    assert short.retained == pytest.approx(np.exp(-GMS.relaxation_rate * 1e-4), rel=1e-3)


def test_another_coulomb_force_scales_the_elements():
    state = FrictionState.relaxed(4)
    state.forces[:] = [1.0, -2.0, 0.5, 0.0]
    state.rescale(1.5)
    assert state.forces.tolist() == [1.5, -3.0, 0.75, 0.0]
