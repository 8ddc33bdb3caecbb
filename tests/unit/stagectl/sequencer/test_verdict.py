"""Pass or fail per site."""

from dataclasses import replace
from pathlib import Path

from stagectl.recipe import SiteLimits
from stagectl.sequencer import judge
from stagectl.store import read_recording

RECORDING = read_recording(Path(__file__).parents[3] / "data" / "null-1.h5")
MOVES = tuple(replace(m, site=1 + i // 2) for i, m in enumerate(RECORDING.moves))
SITED = replace(RECORDING, moves=MOVES)


def verdicts(**limits):
    return judge(SITED, SiteLimits(**limits), 5e-8, 1e-4, 1e-3)


def test_without_limits_there_is_no_verdict():
    assert verdicts() == ()


def test_a_site_passes_wide_limits_and_fails_tight_ones():
    wide = verdicts(peak_error=1e-3)
    assert [v.site for v in wide] == list(range(1, 20))
    assert not any(v.failures for v in wide)
    tight = verdicts(peak_error=1e-9)
    assert all(v.failures for v in tight)
    assert "peak error" in tight[0].failures[0]


def test_settling_is_judged_on_the_micro_move_late_or_never():
    # Without friction compensation some axis takes longer than that at most sites, not at all.
    some, none = verdicts(settling=0.14), verdicts(settling=1e3)
    assert 0 < sum(bool(v.failures) for v in some) < len(some)
    said = [text for v in some for text in v.failures]
    late = [text for text in said if "settled in" in text]
    assert late
    assert all(float(text.split()[3]) >= 140 for text in late)
    never = [text for v in none for text in v.failures]
    assert len(never) < len(none)
    assert all(text.endswith("did not settle") for text in never)
    assert len(said) == len(late) + len(never)


def test_a_site_that_was_repeated_is_judged_on_its_last_visit():
    kinds = ("macro", "micro") * 2
    visits = [
        replace(m, site=1, kind=kind) for m, kind in zip(RECORDING.moves[:4], kinds, strict=True)
    ]
    said = [
        judge(replace(RECORDING, moves=tuple(moves)), SiteLimits(None, 1e-9), 5e-8, 1e-4, 1e-3)
        for moves in (visits[:2], visits[2:], visits)
    ]
    assert said[0] != said[1] == said[2]
