"""Homing to the index mark, which is at the plant's true zero, and its statusword bits."""

import pytest

BITS = 0x3400  # 13 error, 12 attained, 10 target reached
UNDER_WAY, NOT_STARTED, ATTAINED_MOVING, DONE = 0x0000, 0x0400, 0x1000, 0x1400


def run(host, limit_ms=8000):
    """Start homing; statusword bits of every millisecond until something other than 000."""
    host.control(0x1F)
    seen = []
    for _ in range(limit_ms):
        host.wait(1)
        seen.append(host.statusword() & BITS)
        if seen[-1] != UNDER_WAY:
            break
    return seen


@pytest.fixture
def homing(host):
    host.write(1, 0x6099, 1, "I", 50_000_000)
    host.write(1, 0x6099, 2, "I", 10_000_000)
    host.enable(6)
    return host


@pytest.mark.parametrize("method", [33, 34])
@pytest.mark.parametrize("start", [2.5e-3, -4e-3, 30e-3, -30e-3, 0.0])
def test_finds_the_index_from_either_side(homing, plant, method, start):
    homing.control(0x00)
    plant.actual[0] = start
    homing.enable(6)
    homing.write(1, 0x6098, 0, "b", method)
    assert homing.statusword() & BITS == NOT_STARTED
    seen = run(homing)
    assert seen[-1] == DONE
    assert len(seen) > 20
    assert plant.actual[0] == pytest.approx(0.0, abs=1e-12)
    assert homing.read_object(1, 0x6064, 0, "i") == 0
    # the direction of method and the range switches: it never goes further than it has to
    assert homing.control(0x0F) & BITS == DONE


def test_search_starts_as_the_method_says_and_reverses_beyond_the_range(homing, plant):
    homing.write(1, 0x6098, 0, "b", 34)  # positive, but the mark is on the negative side
    plant.commands.clear()
    run(homing)
    path = [c[2] for c in plant.commands]
    assert 10e-3 < max(path) < 13e-3
    assert path[0] > 2.5e-3


def test_home_offset_moves_the_zero(homing, plant):
    homing.write(1, 0x607C, 0, "i", 1_500_000)
    homing.write(1, 0x6098, 0, "b", 33)
    assert run(homing)[-1] == DONE
    assert homing.read_object(1, 0x6064, 0, "i") == -1_500_000


def test_an_unknown_method_is_an_error(homing, plant):
    homing.write(1, 0x6098, 0, "b", 17)
    seen = run(homing)
    assert seen[-1] & 0x2000
    homing.wait(5)
    assert homing.statusword() & BITS == 0x2400
    assert homing.statusword() & 0x6F == 0x27  # an error of homing is no fault


def test_interrupted_homing_is_not_done(homing, plant):
    homing.write(1, 0x6098, 0, "b", 33)
    homing.control(0x1F)
    homing.wait(30)
    assert homing.statusword() & BITS == UNDER_WAY
    homing.control(0x0F)
    homing.wait(200)
    assert homing.statusword() & BITS == NOT_STARTED
    stopped = plant.actual[0]
    homing.wait(100)
    assert plant.actual[0] == stopped > 0
    assert run(homing)[-1] == DONE


def test_halt_pauses_the_search(homing, plant):
    homing.write(1, 0x6098, 0, "b", 33)
    homing.control(0x1F)
    homing.wait(20)
    homing.control(0x11F)
    homing.wait(200)
    stopped = plant.actual[0]
    assert homing.statusword() & 0x0400
    homing.wait(50)
    assert plant.actual[0] == stopped > 0
    homing.control(0x1F)
    homing.wait(1500)
    assert homing.statusword() & BITS == DONE
