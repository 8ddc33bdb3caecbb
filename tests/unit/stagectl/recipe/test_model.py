"""Lists of moves, unrolled."""

from stagectl.recipe.model import Repeat, count_unrolled, unroll
from stagectl.recipe.schema import Dwell

NESTED = (
    Dwell(1.0),
    Repeat(2, (Dwell(2.0), Repeat(3, (Dwell(3.0),)))),
    Dwell(4.0),
)


def test_repeats_unroll_in_order_each_with_its_place_in_the_file():
    found = list(unroll(NESTED))
    assert [move.duration for _, move in found] == [1, 2, 3, 3, 3, 2, 3, 3, 3, 4]
    assert found[0][0] == ("moves", 0)
    assert found[1][0] == found[5][0] == ("moves", 1, "moves", 0)
    assert found[2][0] == ("moves", 1, "moves", 1, "moves", 0)
    assert found[-1][0] == ("moves", 2)


def test_the_count_needs_no_unrolling():
    assert count_unrolled(NESTED) == len(list(unroll(NESTED)))
    deep = (Dwell(1.0),)
    for _ in range(12):
        deep = (Repeat(1000, deep),)
    assert count_unrolled(deep) == 1000**12
