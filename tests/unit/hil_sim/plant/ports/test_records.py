"""The arena that the ports' records point into."""

import numpy as np

from hil_sim.plant.ports.records import Arena


def test_the_arena_knows_where_everything_begins():
    arena = Arena()
    assert arena.add([1.0, 2.0]) == 0
    assert arena.add(None) == arena.add([]) == -1
    assert arena.add([(3.0, 4.0), (5.0, 6.0)]) == 2
    assert arena.add(np.array([7.0])) == 6
    np.testing.assert_array_equal(arena.array(), [1, 2, 3, 4, 5, 6, 7, 0])
    assert len(Arena().array()) == 1  # never empty
