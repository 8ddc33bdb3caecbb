"""Scores of a blind check; nothing here affects what the diagnosis says.

A cause is right where axis and family are those of the key. Terms and thresholds:
docs/formats/gap-report.md, docs/blind.md.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from sim2real.blind.outcome import Outcome, ReportedCause
from sim2real.findings import NO_GAP, PARTLY_EXPLAINED, UNEXPLAINED

BIN = 50
"""Least number of causes in a bin of the calibration."""
SIGMAS = 3.0
PROMISE = 0.08
"""Largest difference between the gap closed on a second run and what was promised."""
CONFIDENT = 0.5
HONEST = 0.9
"""Naming a relative of an effect that the library lacks is honest below this probability."""
NEAR: tuple[frozenset[str], ...] = (
    frozenset({"force_offset", "cable_stiffness", "cogging"}),
    frozenset(
        {"coulomb_level", "friction_position", "thermal_drift", "friction_asymmetry", "stribeck"}
    ),
    frozenset({"payload_mass", "force_constant", "force_saturation", "resonance"}),
    frozenset({"current_bandwidth", "dead_time"}),
    frozenset({"cable_hysteresis", "presliding_stiffness", "coulomb_level"}),
    frozenset({"viscous_damping", "coulomb_level", "stribeck"}),
    frozenset({"force_offset", "friction_asymmetry"}),
    frozenset({"cogging", "force_ripple"}),
)
"""Effects that differ by a special value, or only in details of the response."""

Pair = tuple[str, str]
"""Axis and name."""


@dataclass(frozen=True, slots=True)
class Share:
    """A count out of a total."""

    count: int
    of: int

    @property
    def value(self) -> float | None:
        """0..1; None where the total is 0."""
        return self.count / self.of if self.of else None


@dataclass(frozen=True, slots=True)
class Bin:
    """Causes of similar probability: their number, mean probability, and share of right ones."""

    causes: int
    probability: float
    right: float


@dataclass(frozen=True, slots=True)
class Score:
    """The figures of a blind check.

    Attributes:
        trials: all of them.
        errors: those without a report.
        one: the right axis and name first.
        one_with_sets: the same, or a confusable set with the first contains it.
        one_only: the right name, and no other.
        none: verdict `no_gap`.
        alarms: trials without an effect in which one was named.
        outside: no name above 0.5.
        coordinate: the same kind, the right coordinate first or among those alike.
        two: both named.
        two_safe: at least one right and none wrong.
        several: all of three to six effects on one axis named.
        several_safe: the same kind, none wrong.
        family: another shape: the family is named on the axis, or the right coordinate is given.
        remainder: the same, and what is left is admitted.
        left_out: safe answers, or an honest relative, where the true effects were not in the
            library.
        parameters: within 3 of their sigmas.
        promise: gap closed on the second run within 0.08 of what was promised.
        twin: the same of the twin as it is written.
        within, twin_within: as these two, at positions where the first run has been to.
        closed: median gap closed with the one effect named correctly, None where there is none.
        error: expected calibration error, None without causes.
        bins: that it is made of.
        seconds: median and longest time of a diagnosis.
        processor: median of the processor time of all cores together, None where unknown.
        confusion: (true family, first name reported) -> trials with one effect.
    """

    trials: int
    errors: int
    one: Share
    one_with_sets: Share
    one_only: Share
    none: Share
    alarms: Share
    outside: Share
    coordinate: Share
    two: Share
    two_safe: Share
    several: Share
    several_safe: Share
    family: Share
    remainder: Share
    left_out: Share
    parameters: Share
    promise: Share
    twin: Share
    within: Share
    twin_within: Share
    closed: float | None
    error: float | None
    bins: tuple[Bin, ...]
    seconds: tuple[float, float]
    processor: float | None
    confusion: dict[Pair, int]


def score_outcomes(outcomes: Sequence[Outcome]) -> Score:
    """The figures of a blind check."""
    known = [o for o in outcomes if not o.leave_out]
    of_kind = {
        kind: [o for o in known if o.kind == kind]
        for kind in ("one", "two", "none", "outside", "departing", "several")
    }
    one = of_kind["one"]
    deviations = [value for o in known for value in o.sigmas.values()]
    closed = [o.promised for o in one if is_first_right(o) and o.promised is not None]
    bins = calibration_bins(
        (cause.probability, right) for o in known for cause, right in judge_causes(o)
    )
    causes = sum(b.causes for b in bins)
    seconds = [o.seconds for o in outcomes]
    processor = [o.processor for o in outcomes if np.isfinite(o.processor)]
    return Score(
        len(outcomes),
        sum(bool(o.error) for o in outcomes),
        _share(one, is_first_right),
        _share(one, is_first_right_or_set),
        _share(one, lambda o: is_first_right(o) and len(confident(o)) == 1),
        _share(of_kind["none"], lambda o: o.verdict == NO_GAP),
        _share(of_kind["none"], lambda o: bool(confident(o))),
        _share(of_kind["outside"], is_safe),
        _share(of_kind["outside"], is_coordinate_right),
        _share(of_kind["two"], lambda o: true_pairs(o) <= confident(o)),
        _share(of_kind["two"], lambda o: bool(confident(o)) and confident(o) <= true_pairs(o)),
        _share(of_kind["several"], lambda o: true_pairs(o) <= confident(o)),
        _share(of_kind["several"], lambda o: confident(o) <= true_pairs(o)),
        _share(of_kind["departing"], is_family_right),
        _share(
            of_kind["departing"],
            lambda o: is_family_right(o) and o.verdict in (PARTLY_EXPLAINED, UNEXPLAINED),
        ),
        _share([o for o in outcomes if o.leave_out and o.truth], is_honest),
        Share(sum(abs(value) <= SIGMAS for value in deviations), len(deviations)),
        _kept((o.promised, o.second) for o in known),
        _kept((o.promised_by_twin, o.second_by_twin) for o in known),
        _kept((o.promised, o.within) for o in known),
        _kept((o.promised_by_twin, o.within_by_twin) for o in known),
        float(np.median(closed)) if closed else None,
        sum(b.causes * abs(b.probability - b.right) for b in bins) / causes if causes else None,
        bins,
        (float(np.median(seconds)), max(seconds)) if seconds else (0.0, 0.0),
        float(np.median(processor)) if processor else None,
        dict(Counter((o.truth[0].kin, _first_name(o)) for o in one)),
    )


def _kept(pairs: Iterable[tuple[float | None, float | None]]) -> Share:
    """How often what was promised was closed, of the pairs where both are known."""
    off = [abs(one - other) for one, other in pairs if one is not None and other is not None]
    return Share(sum(each <= PROMISE for each in off), len(off))


def true_pairs(outcome: Outcome) -> set[Pair]:
    """Axis and family of the true effects that have a family."""
    return {(drawn.axis, drawn.kin) for drawn in outcome.truth if drawn.kin}


def confident(outcome: Outcome) -> set[Pair]:
    """Axis and name of the causes above 0.5."""
    return {(t.axis, t.effect) for t in outcome.reported if t.probability > CONFIDENT}


def judge_causes(outcome: Outcome) -> list[tuple[ReportedCause, bool]]:
    """Causes, each with whether it is right."""
    right = true_pairs(outcome)
    return [(cause, (cause.axis, cause.effect) in right) for cause in outcome.reported]


def is_first_right(outcome: Outcome) -> bool:
    """Whether the first cause has the right axis and name."""
    if not outcome.reported:
        return False
    first = outcome.reported[0]
    return (first.axis, first.effect) in true_pairs(outcome)


def is_first_right_or_set(outcome: Outcome) -> bool:
    """The same, or the first cause is in a confusable set with the right one."""
    if is_first_right(outcome):
        return True
    if not outcome.reported:
        return False
    first = outcome.reported[0]
    return any(
        axis == first.axis
        and first.effect in names
        and any((axis, name) in true_pairs(outcome) for name in names)
        for axis, names in outcome.confusable
    )


def is_safe(outcome: Outcome) -> bool:
    """Whether no effect is named that does not act."""
    return not outcome.error and confident(outcome) <= true_pairs(outcome)


def is_coordinate_right(outcome: Outcome) -> bool:
    """Whether the first coordinate of an axis, or one alike, is that of an effect on it."""
    right = {(drawn.axis, drawn.over) for drawn in outcome.truth if drawn.over}
    return any((axis, over) in right for axis, names in outcome.unlisted[:1] for over in names)


def is_family_right(outcome: Outcome) -> bool:
    """Whether the family of an effect in another shape is named, or its coordinate given."""
    return is_safe(outcome) and (bool(confident(outcome)) or is_coordinate_right(outcome))


def is_honest(outcome: Outcome) -> bool:
    """Whether an answer is safe, or names near relatives of what was left out, hesitantly."""
    if is_safe(outcome):
        return True
    true = true_pairs(outcome)
    return not outcome.error and all(
        cause.probability < HONEST
        and any(
            cause.axis == axis and any({name, cause.effect} <= near for near in NEAR)
            for axis, name in true
        )
        for cause in outcome.reported
    )


def calibration_bins(causes: Iterable[tuple[float, bool]]) -> tuple[Bin, ...]:
    """Causes in order of their probability, in bins of equal size of at least 50 (or one bin)."""
    ranked = sorted(causes, key=lambda cause: cause[0])
    if not ranked:
        return ()
    parts = np.array_split(np.array(ranked, dtype=np.float64), max(1, len(ranked) // BIN))
    return tuple(
        Bin(len(part), float(part[:, 0].mean()), float(part[:, 1].mean())) for part in parts
    )


def is_wrong(outcome: Outcome) -> bool:
    """Whether the trial counts against the diagnosis in its main row."""
    if outcome.leave_out:
        return bool(outcome.truth) and not is_honest(outcome)
    checks: dict[str, Callable[[Outcome], bool]] = {
        "one": lambda o: is_first_right_or_set(o) and confident(o) <= true_pairs(o),
        "two": lambda o: confident(o) == true_pairs(o),
        "several": lambda o: confident(o) == true_pairs(o),
        "none": lambda o: o.verdict == NO_GAP,
        "outside": is_safe,
        "departing": is_family_right,
    }
    return not checks[outcome.kind](outcome)


def _share(outcomes: Sequence[Outcome], holds: Callable[[Outcome], bool]) -> Share:
    return Share(sum(holds(o) for o in outcomes), len(outcomes))


def _first_name(outcome: Outcome) -> str:
    if outcome.error:
        return "error"
    if not outcome.reported:
        return outcome.verdict
    first = outcome.reported[0]
    other = first.axis != outcome.truth[0].axis
    return first.effect + (" (other axis)" if other else "")
