"""The gain chosen: as large as the sensitivity allows, and not larger."""

from __future__ import annotations

from dataclasses import replace

import pytest

from estimation.observer import AxisFigures, Mode, design_observer
from estimation.observer.design import carriages
from estimation.observer.loop import period_maps
from estimation.observer.sensitivity import (
    GAINS,
    LATENCIES,
    PEAK,
    PEAK_OVER_DRIVE,
    drive_alone,
    peak_sensitivity,
    with_observer,
)
from tests.unit.estimation.observer.axes import CARRIAGE, DRIVE, FIGURES, PERIOD


def excess(figures: AxisFigures, gain: float) -> float:
    """Largest peak over what is allowed, over figures that are off and latencies."""
    model = design_observer(figures).model
    worst = 0.0
    for carriage in carriages(figures):
        maps = period_maps(figures.drive, carriage, PERIOD)
        most = max(PEAK, PEAK_OVER_DRIVE * peak_sensitivity(drive_alone(maps), PERIOD))
        for latency in LATENCIES:
            peak = peak_sensitivity(with_observer(maps, model, gain, latency), PERIOD)
            worst = max(worst, peak / most)
    return worst


@pytest.mark.parametrize(
    "figures",
    [
        FIGURES,
        replace(FIGURES, mass_doubt=0.15),
        replace(FIGURES, drive=replace(DRIVE, delay=0.4e-3)),
        replace(FIGURES, carriage=replace(CARRIAGE, hung=(Mode(0.2, 110.0, 0.02),))),
        replace(FIGURES, carriage=replace(CARRIAGE, base=Mode(0.04, 10.0, 0.1))),
        replace(FIGURES, carriage=replace(CARRIAGE, stiffness=0.0)),
    ],
    ids=["plain", "mass in doubt", "dead time", "resonance", "base", "no presliding"],
)
def test_the_gain_is_the_largest_that_keeps_the_peak(figures: AxisFigures) -> None:
    chosen = design_observer(figures)
    at = GAINS.index(chosen.gain)
    assert excess(figures, chosen.gain) <= 1.0
    assert excess(figures, GAINS[at + 1]) > 1.0
    assert max(*chosen.peaks, chosen.worst_peak) <= max(PEAK, 1.2 * chosen.drive_peak)


def test_doubt_and_delay_cost_gain() -> None:
    plain = design_observer(FIGURES).gain
    assert 0.1 < plain < 0.2
    assert design_observer(replace(FIGURES, mass_doubt=0.15)).gain < plain
    resonant = replace(CARRIAGE, hung=(Mode(0.2, 110.0, 0.02),))
    assert design_observer(replace(FIGURES, carriage=resonant)).gain < plain


def test_the_peak_is_kept_where_friction_slips() -> None:
    """With all of the presliding stiffness in the model, it would not be at half that gain."""
    chosen = design_observer(FIGURES)
    slipping = period_maps(DRIVE, replace(CARRIAGE, stiffness=0.0), PERIOD)
    assert peak_sensitivity(with_observer(slipping, chosen.model, chosen.gain, 2), PERIOD) <= PEAK


def test_a_drive_at_its_limit_gets_no_observer() -> None:
    late = replace(DRIVE, delay=2.0e-3)
    figures = replace(FIGURES, drive=late)
    chosen = design_observer(figures)
    assert chosen.gain == 0.0 or excess(figures, chosen.gain) <= 1.0
