"""Handlers by CAN-ID in their order, and actions that are cancelled."""

from __future__ import annotations

from hil_sim.bus.subscriptions import Subscriptions


def test_undoing_a_subscription_leaves_the_others_and_no_empty_entry():
    table = Subscriptions()

    def one(data): ...

    def other(data): ...

    table.subscribe(0x80, one)
    table.subscribe(0x80, other)
    table.unsubscribe(0x80, one)
    assert table[0x80] == (other,)
    table.unsubscribe(0x80, one)  # harmless
    table.unsubscribe(0x81, one)
    table.unsubscribe(0x80, other)
    assert not table


def test_a_frame_that_is_being_handed_out_is_not_disturbed_by_an_unsubscription():
    table = Subscriptions()
    heard: list[str] = []

    def once(data):
        heard.append("once")
        table.unsubscribe(0x80, once)

    table.subscribe(0x80, once)
    table.subscribe(0x80, lambda data: heard.append("always"))
    for _ in range(2):
        for handler in table[0x80]:
            handler(b"")
    assert heard == ["once", "always", "always"]
