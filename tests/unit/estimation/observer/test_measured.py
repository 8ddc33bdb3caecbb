"""Margins by a response, against the eigenvalues of the whole loop."""

import numpy as np
import pytest

from estimation.observer import Carriage, DriveLoop
from estimation.observer.loop import period_maps
from estimation.observer.measured import MeasuredLoop
from estimation.observer.model import make_model
from estimation.observer.sensitivity import peak_sensitivity, with_observer
from estimation.response import AxisResponse, Clocking, FrequencyResponse, Lines

PERIOD = 1e-3
DRIVE = DriveLoop(341e3, 16.07e6, 2714.0, 8.842e-4, 1500.0, 1e-4)
CLOCKING = Clocking(PERIOD, 1e-4, 1500.0)
CARRIAGE = Carriage(8.0, 6e5, 20.0)


def response(stiffness):
    """Without noise, from the matrices of an axis."""
    maps = period_maps(DRIVE, Carriage(8.0, stiffness, 20.0), PERIOD)
    at = np.arange(2.0, 495.0, 1.0)
    z = np.exp(2j * np.pi * at * PERIOD)
    inside = z[:, None, None] * np.eye(len(maps.transition)) - maps.transition
    shares = np.arange(1, 11) / 10.0
    by_offset = maps.ramp_to + maps.ramp_from / z[:, None]
    by_demand = -(maps.noise @ shares) - (maps.noise @ (1.0 - shares)) / z[:, None]
    offset, demand = (
        np.linalg.solve(inside, by[:, :, None])[:, 0, 0] for by in (by_offset, by_demand)
    )
    none = np.zeros(len(at))
    return FrequencyResponse(at, at, offset, demand, none, none)


@pytest.fixture(scope="module")
def measured():
    return MeasuredLoop(AxisResponse(response(6e5), response(0.0)), CLOCKING)


@pytest.fixture(scope="module")
def model():
    return make_model(DRIVE, Carriage(8.0, 4.5e5, 20.0), PERIOD, 0.3, 1e-9)


@pytest.mark.parametrize("latency", [1, 2, 3, 4])
@pytest.mark.parametrize("gain", [0.03, 0.12, 0.5, 1.0])
def test_stability_is_that_of_the_eigenvalues(measured, model, gain, latency):
    for margins, share in zip(measured.margins(model, gain, latency), (0.0, 0.5, 1.0), strict=True):
        maps = period_maps(DRIVE, Carriage(8.0, share * 6e5, 20.0), PERIOD)
        peak = peak_sensitivity(with_observer(maps, model, gain, latency), PERIOD)
        assert (margins.gain > 1.0) == (peak < float("inf"))
        if peak < 2.2:  # what is asked for
            assert margins.peak == pytest.approx(peak, rel=0.06)


def test_the_drive_alone(measured):
    maps = period_maps(DRIVE, Carriage(8.0, 0.0, 20.0), PERIOD)
    from estimation.observer.sensitivity import drive_alone

    alone = peak_sensitivity(drive_alone(maps), PERIOD)
    assert measured.drive_peaks[0] == pytest.approx(alone, rel=0.06)


def test_an_uncertain_response_counts_against_the_loop(model):
    sure = AxisResponse(response(6e5), response(0.0))
    doubted = AxisResponse(*(
        FrequencyResponse(r.offset_at, r.demand_at, r.offset, r.demand,
                          0.2 * np.abs(r.offset), r.demand_sigma)
        for r in sure
    ))  # fmt: skip
    margin, doubtful = (
        MeasuredLoop(r, CLOCKING).margins(model, 0.12)[0].gain for r in (sure, doubted)
    )
    assert doubtful == pytest.approx(margin / 1.4, rel=0.02)


def test_the_closed_form_is_the_matrices_response():
    from estimation.response import Figures

    exact = response(6e5)
    figures = Figures(8.0, 341e3, 16.07e6, 2714.0, 8.842e-4, stiffness=6e5, loss=20.0)
    offset, demand = Lines(exact.offset_at, CLOCKING).responses(figures, slides=False)
    assert np.abs(offset / exact.offset - 1.0).max() < 0.03
    assert np.abs(demand / exact.demand - 1.0).max() < 0.03
