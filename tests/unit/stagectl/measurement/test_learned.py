"""Facts of a profile by moves: only what they determine."""

from stagectl.measurement.learned import facts_of_scale
from stagectl.measurement.scale import OFFSET, PUSH, Compared


def sign(*found):
    compared = [Compared(what, 1.0, value, None) for what, value in found]
    return [value for _, value, _ in facts_of_scale(compared)]


def test_the_sign_of_force_offsets_needs_force_and_position_to_agree():
    assert sign((OFFSET, 0.9), (PUSH, 1e-8)) == [1]
    assert sign((OFFSET, -0.9), (PUSH, -1e-8)) == [-1]
    assert sign((OFFSET, 0.9), (PUSH, -1e-8)) == []
    assert sign((PUSH, -1e-8)) == [-1]
    assert sign((OFFSET, None), (PUSH, 0.0)) == []
    assert sign() == []
