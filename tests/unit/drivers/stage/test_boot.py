"""Boot on scripted drives: the order of its steps, doubled ids, and a second boot."""

import pytest

from drivers.errors import ConfigurationError, NodeError


def nmt(scripted):
    """NMT commands sent, each with its node."""
    return [(d[0], d[1]) for _, can_id, d in scripted.sent if can_id == 0x000]


def test_opening_sends_nothing_and_booting_starts_the_nodes_last(opened, scripted):
    assert scripted.sent == []
    with opened:
        opened.boot()
        assert [d.nmt for d in scripted.drives] == [5, 5]
        started = [number for number, (command, _) in enumerate(nmt(scripted)) if command == 1]
        assert started == [len(nmt(scripted)) - 2, len(nmt(scripted)) - 1]
        # both are configured by then: no write comes after a start
        first_start = next(i for i, f in enumerate(scripted.sent) if f[1] == 0 and f[2][0] == 1)
        later = [f for f in scripted.sent[first_start:] if f[1] in (0x601, 0x602)]
        assert [f for f in later if f[2][0] & 0xE0 == 0x20] == []


def test_a_node_that_is_missing_is_named_and_no_other_is_started(opened, scripted):
    scripted.drives[1].silent = True
    with opened, pytest.raises(NodeError, match=r"^axis y: no boot-up .*from node 2 within 2 s"):
        opened.boot()
    assert 1 not in [command for command, _ in nmt(scripted)]


def test_a_drive_that_cannot_be_configured_is_not_started(opened, scripted):
    scripted.drives[0].objects[0x6072, 0] = 9999
    scripted.drives[0].stuck.add((0x6072, 0))
    with opened, pytest.raises(ConfigurationError, match=r"^axis x: 0x6072:00 "):
        opened.boot()
    assert 1 not in [command for command, _ in nmt(scripted)]


def test_a_second_boot_resets_and_configures_again(opened, scripted):
    with opened:
        opened.boot()
        opened.enable()
        scripted.drives[0].objects[0x6065, 0] = 5
        resets = [c for c, _ in nmt(scripted)].count(130)
        opened.boot()
        assert [c for c, _ in nmt(scripted)].count(130) > resets
        assert scripted.drives[0].objects[0x6065, 0] == 1_000_000
        assert not opened.homed
        assert not opened.enabled
        opened.enable()
        assert opened.enabled
