"""Methods are counted alike on the same stages."""

from __future__ import annotations

from sim2real.blind.method_table import compare_methods
from sim2real.blind.outcome import Baseline, Outcome
from tests.unit.sim2real.blind.outcomes import outcome


def asked(kind: str, truth: str, reported: str, *named: tuple[str, str]) -> Outcome:
    said = Baseline(named, 0.5 if named else None, 1.0)
    return outcome(kind, truth, reported, "explained", second=0.9, baselines={"other": said})


def test_names_beside_the_right_ones_are_counted_apart() -> None:
    outcomes = [
        asked("one", "x cogging", "x cogging 0.9", ("x", "cogging"), ("x", "dead_time")),
        asked("one", "y cogging", "y cogging 0.9, y dead_time 0.4", ("x", "cogging")),
        asked("none", "", "", ("x", "cogging")),
        asked("outside", "x force_bump", ""),
    ]
    rows = {row[0]: row[1:] for row in compare_methods(outcomes, ["other"])}
    assert rows["one effect: named"] == ["2 of 2", "1 of 2"]
    assert rows["one effect: named, and nothing else"] == ["2 of 2", "0 of 2"]
    assert rows["no effect, or of no family: nothing named"] == ["2 of 2", "1 of 2"]
    assert rows["gap closed on the second run, median"] == ["0.90", "0.50"]
    assert "two effects: both named" not in rows


def test_what_other_methods_say_is_written_and_read_back() -> None:
    before = asked("one", "x cogging", "x cogging 0.9", ("x", "cogging"))
    assert Outcome.from_json(before.to_json()).baselines == before.baselines
