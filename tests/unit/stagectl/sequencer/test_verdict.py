"""Pass or fail per site."""

from dataclasses import replace
from pathlib import Path

from stagectl.recipe import SiteLimits
from stagectl.sequencer import judge
from stagectl.store import read_recording

RECORDING = read_recording(Path(__file__).parents[3] / "data" / "null-1.h5")
SITED = replace(
    RECORDING,
    moves=tuple(replace(m, site=1 + i // 2) for i, m in enumerate(RECORDING.moves)),
)


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


def test_settling_is_judged_on_the_micro_move():
    # Without friction compensation some axis takes longer than that at most sites, not at all.
    some = verdicts(settling=0.14)
    failed = [v for v in some if v.failures]
    assert 0 < len(failed) < len(some)
    assert all("settle" in text for v in failed for text in v.failures)


def test_only_what_settles_late_or_never_fails():
    late = [text for v in verdicts(settling=0.14) for text in v.failures if "settled in" in text]
    assert late
    assert all(float(text.split()[3]) >= 140 for text in late)
    never = [text for v in verdicts(settling=1e3) for text in v.failures]
    assert all(text.endswith("did not settle") for text in never)
    assert len(never) < len(verdicts(settling=1e3))


def test_a_site_that_was_repeated_is_judged_on_its_last_visit():
    first, second = (
        [
            replace(move, site=1, kind=kind)
            for move, kind in zip(moves, ("macro", "micro"), strict=True)
        ]
        for moves in (RECORDING.moves[:2], RECORDING.moves[2:4])
    )
    said = [
        judge(replace(RECORDING, moves=tuple(moves)), SiteLimits(None, 1e-9), 5e-8, 1e-4, 1e-3)
        for moves in (first, second, first + second)
    ]
    assert said[0] != said[1] == said[2]
