"""The page of a blind check in Markdown: docs/blind.md is written by this and nothing else.

No dates: seed, number of trials, version label and machine are what identifies a check.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from sim2real.blind.draw import LEAST, SHARES
from sim2real.blind.outcome import Outcome
from sim2real.blind.score import BIN, Score, Share, is_wrong, score_outcomes

_READING = f"""\
# The blind check

`stagectl gap blind --trials N --seed S --lines F --docs docs/blind.md` wrote this page. Each trial
draws what is wrong with a stage, seals the answer (a SHA-256 of key and nonce is printed before the
diagnosis starts, both after it; `printf %s%s KEY NONCE | sha256sum` verifies it), records the stage
for ten seconds, diagnoses the recording, and compares what was promised with a second recording of
the same stage with other moves. Ctrl-C interrupts the check, and the next run continues from F; F
may hold several seeds.

## What is drawn

| share of trials | what | right answer |
| --- | --- | --- |
| {SHARES["one"]:.2f} | one effect of the library | its axis and name first |
| {SHARES["two"]:.2f} | two of them, on the same or different axes | both names |
| {SHARES["none"]:.2f} | none | `no_gap` |
| {SHARES["outside"]:.2f} | one of no family (quadratic drag, force bump, random walk, ...) | \
its coordinate, and no name above 0.5 |
| {SHARES["departing"]:.2f} | one of a family, in another shape (cogging with harmonics, another \
profile, another warm-up law, ...) | the family's name or its coordinate |

- Names are equally likely, sizes uniform over the ranges of docs/formats/effects.md (in the
  logarithm where these span a ratio), redrawn until each effect alone opens a combined gap of
  {LEAST:g} floors.
- Moves: jerk-limited macro-moves up to 0.5 m/s and 3 m/s^2, micro-moves up to 80 um, 0.01 m/s and
  0.2 m/s^2, rests of 0.05 to 0.3 s, both axes at a time; speeds, jerk, reach and order are random.
  The force offset is the nominal mass times the demanded acceleration.
- The stage takes 8 or 10 plant steps per control tick where the machine file's model takes 5; its
  seven plant figures deviate independently by the machine file's `tolerance`; encoder noise and
  friction wander have seeds of their own. The number of friction elements is the machine file's
  (`--elements` changes it; the diagnosis then faces a stage that its model cannot describe).
- The model's own step is not converged; how much finer the stage's is, the diagnosis has to
  estimate. `--substeps 5` takes the model's step, which shows how much is due to that.
- With `--effects N` every trial has N effects of the library on one axis.
- With `--leave-out` the true effects are removed from the library before the diagnosis, and with
  them those of the same equation under another name (`torque_ripple`, `transmission_ripple`). The
  right answer is then as for an effect of no family, or a near relative at a probability below 0.9.

## How to read it

A cause counts as right where axis and family are those of the key. Calibration: causes of all
trials in order of probability, in bins of at least {BIN}; the error is the mean distance between
a bin's mean probability and its share of right causes. Parameters are measured in their own sigma;
a missing sigma counts as outside. The promises are the report's `gap_closed` and
`gap_closed_by_twin`; each is compared with the gap closed by the same model on the second run, and
on the part of it at positions where the first run has been to: no curve over position is known
beyond. A trial without a report is wrong. Seconds include channels, floor and location; where the
machine had other work, only the processor seconds (of all cores together) are meaningful.
"""

_ROWS: tuple[tuple[str, str, float | None], ...] = (
    ("one effect: right axis and name first", "one", 0.97),
    ("the same, counting a named confusable set", "one_with_sets", 0.99),
    ("one effect: right, and nothing else named", "one_only", None),
    ("no effect: `no_gap`", "none", 0.98),
    ("no effect: something named", "alarms", None),
    ("outside the library: no wrong name", "outside", 0.95),
    ("outside the library: right coordinate first or alike", "coordinate", 0.80),
    ("two effects: both named", "two", 0.90),
    ("two effects: at least one right and none wrong", "two_safe", 0.96),
    ("three to six effects on one axis: all named", "several", 0.80),
    ("three to six effects on one axis: none wrong", "several_safe", 0.95),
    ("another shape: family named or coordinate given", "family", 0.95),
    ("another shape: the same, remainder admitted", "remainder", None),
    ("true effects left out of the library: safe or honest relative", "left_out", None),
    ("true parameters within 3 sigma", "parameters", 0.97),
    ("gap closed as promised, within 0.08, on the second run", "promise", 0.95),
    ("the same of the twin as it is written", "twin", 0.95),
    ("gap closed as promised, at positions where the first run has been to", "within", 0.95),
    ("the same of the twin as it is written", "twin_within", 0.95),
)


def write_page(outcomes: Sequence[Outcome], facts: Mapping[str, str]) -> str:
    """The whole page.

    Args:
        outcomes: of any seeds; those with the true effects left out have a row of their own.
        facts: version and machine that were checked, name -> value.
    """
    counted = score_outcomes(outcomes)
    seeds = sorted({o.seed for o in outcomes})
    lines = [_READING, "## Figures", ""]
    lines += [f"- {name}: {value}" for name, value in facts.items()]
    lines += [
        f"- seeds: {', '.join(map(str, seeds))}; trials: {counted.trials}, without report: "
        f"{counted.errors}",
        "",
    ]
    return "\n".join(
        [
            *lines,
            *table_rows(counted),
            *_confusion(counted),
            *_failures(outcomes),
        ]
    )


def table_rows(counted: Score) -> list[str]:
    """The rows of the table and of the calibration."""
    lines = [
        "| on sealed effects | trials | found | asked |",
        "| --- | --- | --- | --- |",
    ]
    for text, name, asked in _ROWS:
        share: Share = getattr(counted, name)
        value = share.value
        if value is None:
            continue
        want = "" if asked is None else f">= {100 * asked:.0f} %"
        lines.append(f"| {text} | {share.count} of {share.of} | {100 * value:.0f} % | {want} |")
    if counted.closed is not None:
        lines.append(
            f"| gap closed with the right effect named, median | {counted.one.count} | "
            f"{counted.closed:.2f} | >= 0.9 |"
        )
    if counted.error is not None:
        causes = sum(b.causes for b in counted.bins)
        lines.append(
            f"| expected calibration error | {causes} causes | {counted.error:.3f} | <= 0.06 |"
        )
    lines.append(
        f"| seconds per diagnosis, median (longest) | {counted.trials} | "
        f"{counted.seconds[0]:.0f} ({counted.seconds[1]:.0f}) | <= 20, on quiet cores |"
    )
    if counted.processor is not None:
        lines.append(f"| processor seconds per diagnosis, median | | {counted.processor:.0f} | |")
    if counted.bins:
        lines += ["", "| causes | mean probability | right |", "| --- | --- | --- |"]
        lines += [f"| {b.causes} | {b.probability:.3f} | {b.right:.3f} |" for b in counted.bins]
    return [*lines, ""]


def _confusion(counted: Score) -> list[str]:
    if not counted.confusion:
        return []
    lines = [
        "One effect, first name reported:",
        "",
        "| true | reported | trials |",
        "| --- | --- | --- |",
    ]
    for (true, named), count in sorted(counted.confusion.items()):
        lines.append(f"| {true} | {'right' if named == true else named} | {count} |")
    return [*lines, ""]


def _failures(outcomes: Sequence[Outcome]) -> list[str]:
    failed = [o for o in outcomes if is_wrong(o)]
    if not failed:
        return []
    lines = [
        "Trials that count as wrong (so does an additional effect beside the right ones):", "",
        "| seed, trial | true | verdict | reported |", "| --- | --- | --- | --- |",
    ]  # fmt: skip
    lines += [
        f"| {o.seed}, {o.number} | {describe_truth(o)} | {o.error or o.verdict} "
        f"| {describe_reported(o)} |"
        for o in failed
    ]
    return [*lines, ""]


def describe_truth(outcome: Outcome) -> str:
    """The true effects, in a few words."""
    left = " (left out)" if outcome.leave_out and outcome.truth else ""
    return (", ".join(f"{d.axis} {d.effect}" for d in outcome.truth) or "nothing") + left


def describe_reported(outcome: Outcome) -> str:
    """The reported causes and coordinates, in a few words."""
    over = [f"{axis} over {' or '.join(names)}" for axis, names in outcome.unlisted]
    named = ", ".join(f"{t.axis} {t.effect} {t.probability:.2f}" for t in outcome.reported)
    return ", ".join([*([named] if named else []), *over]) or "nothing"
