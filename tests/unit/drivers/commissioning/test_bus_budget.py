"""Bits of frames and cycles, against figures worked out by hand."""

import pytest

from drivers.commissioning import stage_budget
from drivers.commissioning.bus_budget import least_bits, worst_bits


@pytest.mark.parametrize(("size", "least", "worst"), [(0, 47, 55), (1, 55, 65), (8, 111, 135)])
def test_bits_of_a_frame(size, least, worst):
    assert (least_bits(size), worst_bits(size)) == (least, worst)


def test_a_frame_of_nine_bytes_is_refused():
    with pytest.raises(ValueError, match="not 9"):
        stage_budget(("x",), (9,), (), 1e-3, 1_000_000)


@pytest.mark.parametrize(
    ("rpdos", "tpdos", "worst", "least"),
    [((), (8, 8), 595, 491), ((8,), (8, 8), 865, 713), ((4,), (6, 6), 705, 585)],
)
def test_the_budget_of_two_axes(rpdos, tpdos, worst, least):
    budget = stage_budget(("x", "y"), rpdos, tpdos, 1e-3, 1_000_000)
    assert (budget.worst, budget.least, budget.available) == (worst, least, 1000)
    assert budget.peak == worst + 3 * 65


def test_the_bus_time_left_for_sdo():
    full = stage_budget(("x", "y"), (8,), (8, 8), 1e-3, 1_000_000)
    assert not full.fits  # 865 + 3 heartbeats of 65
    assert full.sdo_pairs == 0
    assert full.shortest_period == pytest.approx(1.06e-3)
    slower = stage_budget(("x", "y"), (8,), (8, 8), 4e-3, 1_000_000)
    assert slower.fits
    assert slower.sdo_pairs == (4000 - 865 - 195) // 270
    assert slower.sdo_per_second == pytest.approx((1e6 - 865 * 250 - 3 * 65 * 10) / 270)


def test_the_sync_counter_costs_a_byte():
    plain = stage_budget(("x",), (8,), (8,), 1e-3, 1_000_000)
    counted = stage_budget(("x",), (8,), (8,), 1e-3, 1_000_000, sync_bytes=1)
    assert counted.worst - plain.worst == 10
