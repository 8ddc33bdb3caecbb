"""Other methods name what they can see, and their models close the gap of a second run."""

from __future__ import annotations

import time

import pytest

from hil_sim.settings import StageSettings
from sim2real.blind.baselines import METHODS, run_baselines
from stagedata import Recording
from tests.unit.sim2real.blind.conftest import LIBRARY, TOLERANCE
from tests.unit.sim2real.conftest import stage_with


@pytest.mark.parametrize("method", METHODS)
def test_a_constant_force_is_named_and_closed(
    nominal: tuple[Recording, StageSettings], method: str
) -> None:
    there = {"force_offset": {"force": 3.0}}
    runs = (stage_with(nominal, 1, x=there), stage_with(nominal, 2, 4.0, x=there))
    said = run_baselines(nominal[1], TOLERANCE, LIBRARY, runs, time.process_time)[method]
    assert ("x", "force_offset") in said.named
    assert said.second is not None
    assert said.second > 0.5
