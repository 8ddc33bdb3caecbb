"""Gain and stiffness chosen: what answers most as far as the sensitivity allows."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import replace

import pytest

from estimation.observer import Mode, design_observer
from estimation.observer.design import ASSUMED, carriages
from estimation.observer.loop import period_maps
from estimation.observer.model import make_model
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


def excess(figures, gain, model=None):
    """Largest peak over what is allowed, over figures that are off and latencies."""
    model = model or design_observer(figures).model
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
def test_the_gain_is_the_largest_that_keeps_the_peak(figures):
    chosen = design_observer(figures)
    at = GAINS.index(chosen.gain)
    assert excess(figures, chosen.gain) <= 1.0
    assert excess(figures, GAINS[at + 1]) > 1.0
    assert max(*chosen.peaks, chosen.worst_peak) <= max(PEAK, 1.2 * chosen.drive_peak)


@pytest.mark.parametrize("scale", [0.5, 1.0, 1.5])
def test_no_other_stiffness_answers_more_within_the_peak(scale):
    """The more is assumed, the more a deviation is answered, and the smaller the gain has to be."""
    figures = replace(FIGURES, carriage=replace(CARRIAGE, stiffness=scale * CARRIAGE.stiffness))
    chosen = design_observer(figures)
    stiffnesses = {share * figures.carriage.stiffness for share in ASSUMED}
    for stiffness in stiffnesses - {chosen.assumed_stiffness}:
        gain = GAINS[bisect_right(GAINS, chosen.response / (DRIVE.kp + stiffness))]
        carriage = replace(figures.carriage, stiffness=stiffness)
        model = make_model(DRIVE, carriage, PERIOD, chosen.walk, figures.noise)
        assert excess(figures, gain, model) > 1.0


def test_soft_friction_is_assumed_stiffer():
    """Shares of sigma0: a drive's kp says how much stiffness is worth its gain."""
    shares = []
    for stiffness in (3e5, 9e5):
        figures = replace(FIGURES, carriage=replace(CARRIAGE, stiffness=stiffness))
        shares.append(design_observer(figures).assumed_stiffness / stiffness)
    assert shares[0] > shares[1]


def test_doubt_and_delay_cost_gain():
    plain = design_observer(FIGURES).gain
    assert 0.1 < plain < 0.2
    assert design_observer(replace(FIGURES, mass_doubt=0.15)).gain < plain
    resonant = replace(CARRIAGE, hung=(Mode(0.2, 110.0, 0.02),))
    assert design_observer(replace(FIGURES, carriage=resonant)).gain < plain


def test_the_peak_is_kept_where_friction_slips():
    """With all of the presliding stiffness in the model, it would not be at half that gain."""
    chosen = design_observer(FIGURES)
    slipping = period_maps(DRIVE, replace(CARRIAGE, stiffness=0.0), PERIOD)
    assert peak_sensitivity(with_observer(slipping, chosen.model, chosen.gain, 2), PERIOD) <= PEAK


def test_a_drive_at_its_limit_gets_no_observer():
    late = replace(DRIVE, delay=2.0e-3)
    figures = replace(FIGURES, drive=late)
    chosen = design_observer(figures)
    assert chosen.gain == 0.0 or excess(figures, chosen.gain) <= 1.0
