"""Progress of several phases on one bar."""

from __future__ import annotations

from stagectl.cli.console import join_phases


def test_phases_share_one_bar_that_never_goes_back() -> None:
    bar: list[tuple[str, int, int]] = []
    advance = join_phases(("first", "second"), lambda *state: bar.append(state))
    for what, done, total in (
        ("first", 0, 4), ("first", 2, 4), ("second", 1, 2), ("first", 4, 4), ("second", 2, 2),
        ("second", 0, 0),
    ):  # fmt: skip
        advance(what, done, total)
    assert bar == [
        ("first", 0, 200), ("first", 50, 200), ("second", 150, 200), ("first", 150, 200),
        ("second", 200, 200), ("second", 200, 200),
    ]  # fmt: skip
