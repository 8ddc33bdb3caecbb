"""Handlers by CAN-ID in their order, and actions that are cancelled."""

from __future__ import annotations

from hil_sim.bus.subscriptions import PendingAction, Subscriptions


def test_handlers_of_an_id_are_kept_in_the_order_of_subscription() -> None:
    heard: list[str] = []
    table = Subscriptions()
    for name in ("first", "second", "third"):
        table.subscribe(0x181, lambda data, name=name: heard.append(name))  # type: ignore[misc]
    for handler in table[0x181]:
        handler(b"")
    assert heard == ["first", "second", "third"]
    assert 0x182 not in table


def test_undoing_a_subscription_leaves_the_others_and_no_empty_entry() -> None:
    table = Subscriptions()

    def one(data: bytes) -> None: ...

    def other(data: bytes) -> None: ...

    table.subscribe(0x80, one)
    table.subscribe(0x80, other)
    table.unsubscribe(0x80, one)
    assert table[0x80] == (other,)
    table.unsubscribe(0x80, one)  # harmless
    table.unsubscribe(0x81, one)
    table.unsubscribe(0x80, other)
    assert not table


def test_a_frame_that_is_being_handed_out_is_not_disturbed_by_an_unsubscription() -> None:
    table = Subscriptions()
    heard: list[str] = []

    def once(data: bytes) -> None:
        heard.append("once")
        table.unsubscribe(0x80, once)

    table.subscribe(0x80, once)
    table.subscribe(0x80, lambda data: heard.append("always"))
    for _ in range(2):
        for handler in table[0x80]:
            handler(b"")
    assert heard == ["once", "always", "always"]


def test_a_cancelled_action_is_gone() -> None:
    pending = PendingAction(lambda: None)
    assert pending.action is not None
    pending.cancel()
    pending.cancel()
    assert pending.action is None
