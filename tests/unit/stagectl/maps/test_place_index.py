"""What is near a place."""

import math

from hypothesis import example, given
from hypothesis import strategies as st

from stagectl.maps import PlaceIndex
from tests.unit.stagectl.calls import count_calls

RADIUS = 2e-3
COORDINATE = st.floats(-0.01, 0.01)
PLACE = st.tuples(COORDINATE, COORDINATE)


@given(places=st.lists(PLACE, max_size=30), at=PLACE)
@example(places=[(-RADIUS, 0.0), (RADIUS, 0.0), (0.0, 2 * RADIUS)], at=(0.0, 0.0))
@example(places=[(RADIUS, RADIUS)], at=(RADIUS, -1e-190))
def test_near_is_what_lies_within_the_radius_in_the_order_added(places, at):
    near = PlaceIndex(RADIUS, places).near(at)
    assert near == [n for n, place in enumerate(places) if math.dist(place, at) <= RADIUS]


def test_places_are_found_as_soon_as_they_are_added():
    index = PlaceIndex(RADIUS)
    assert index.near((0.0, 0.0)) == []
    assert [index.add((0.0, 0.0)), index.add((1e-3, 0.0))] == [0, 1]
    assert index.near((0.0, 0.0)) == [0, 1]


def test_a_lookup_costs_no_more_among_more_places():
    few, many = (
        PlaceIndex(RADIUS, [(0.01 * i, 0.01 * j) for i in range(n) for j in range(n)])
        for n in (5, 30)
    )
    at = (0.02, 0.02)
    assert count_calls(lambda: many.near(at)) == count_calls(lambda: few.near(at))
