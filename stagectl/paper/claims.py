"""The paper's six claims, each with figures from runs and the verdict that follows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from stagectl.paper import published
from stagectl.paper.case import Alignment, Case
from stagectl.paper.fit import ALPHA, METHODS, Fit, fit, left_by_zone_a, two_windows, zone_a, zone_b
from stagectl.paper.published import PARAMETERS, REFERENCE, SYMBOLS
from stagectl.paper.simulate import prepare
from stagectl.paper.tables import (
    ALIGNMENTS,
    CONDITIONS,
    INITIAL_NAMES,
    Fixed,
    Tables,
    error,
    one_window_ends,
    times_fewer,
)
from stagectl.report.formats import listed
from stagedata import F64

REPRODUCED, NOT = "reproduced", "not reproduced"
ENCODER_NOISE = 1e-9
"""Rms encoder noise in the runs for the fourth claim [m]; the paper has none."""
_NOTABLE = 1e-4  # relative error worth printing
_LESS = 0.9  # ratio that counts as less, not as equal
_WHERE = {"logged": "the force is taken as logged", "aligned": "force and position are aligned"}


@dataclass(frozen=True, slots=True)
class Claim:
    """A claim of the paper, judged.

    Attributes:
        claim: in short.
        verdict: "reproduced", "reproduced only if ...", or "not reproduced".
        figure: what the verdict rests on.
    """

    claim: str
    verdict: str
    figure: str


def judge(
    case: Case,
    tables: Tables,
    fixed: Fixed,
    runs: int,
    progress: Callable[[], None] = lambda: None,
) -> tuple[Claim, ...]:
    """Judge all six claims.

    Args:
        case: choices under which to judge; the last two claims always with the force aligned.
        tables: of that case.
        fixed: the same with zone A's initial force fixed, for the first three claims.
        runs: number of runs with encoder noise, for the fourth claim.
        progress: called after every run.
    """
    aligned = replace(case, force="aligned")
    found = (
        *(under_fixed_force(claim, tables, fixed) for claim in (nearer, residual, evaluations)),
        attraction(aligned, runs, progress),
        border(aligned),
        robust(aligned),
    )
    return tuple(
        Claim(text, verdict, figure)
        for text, (verdict, figure) in zip(published.CLAIMS, found, strict=True)
    )


def _only(fits: dict[Alignment, bool]) -> str:
    """Verdict on a claim that holds or not for the force as logged and aligned."""
    holding = [force for force, holds in fits.items() if holds]
    if len(holding) == len(fits):
        return REPRODUCED
    return f"{REPRODUCED} only if {_WHERE[holding[0]]}" if holding else NOT


def under_fixed_force(
    claim: Callable[[Tables], tuple[str, str]], tables: Tables, fixed: Fixed
) -> tuple[str, str]:
    """Verdict and figure of a claim; one that does not hold may do so with the force fixed."""
    verdict, figure = claim(tables)
    if verdict != NOT:
        return verdict, figure
    judged = {choice: claim(found)[0] for choice, found in fixed.items()}
    holding = {
        bounds: [initial for initial in INITIAL_NAMES if judged.get((bounds, initial), NOT) != NOT]
        for bounds in CONDITIONS
    }
    # Held under either way of keeping the bounds alike, or under the one that holds more often.
    best = max(holding, key=lambda bounds: len(holding[bounds]))
    initials = holding[best]
    if not initials:
        return NOT, f"{figure} Nor with zone A's initial force fixed."
    conditions = [
        "zone A's initial force does not follow Fc"
        if len(initials) == len(INITIAL_NAMES)
        else f"zone A begins at the {INITIAL_NAMES[initials[0]]}"
    ]
    if any(others != initials for others in holding.values()):
        conditions.append(CONDITIONS[best])
    further = {judged[best, initial].partition(" only if ")[2] for initial in initials}
    conditions += sorted(further - {""})
    ends = one_window_ends(fixed, best)
    stuck = sum(map(bool, ends))
    if stuck:
        figure += f" So fixed, one window stops on a bound in {stuck} of {len(ends)} fits."
    return f"{REPRODUCED} only if {', and '.join(conditions)}", figure


def nearer(tables: Tables) -> tuple[str, str]:
    """Verdict and figure: errors and deviations of one window and two; a tenth less counts."""
    better: dict[Alignment, list[str]] = {}
    figures = []
    for force in ALIGNMENTS:
        one, two = tables["one_window"][force], tables["two_windows"][force]
        better[force] = [
            name
            for name in PARAMETERS
            if abs(error(two, name)) < _LESS * abs(error(one, name))
            and two.sigma[name] < _LESS * one.sigma[name]
        ]
        errors = ", ".join(
            f"{SYMBOLS[name]} {_percent(error(one, name))} and {_percent(error(two, name))}"
            for name in PARAMETERS
            if max(abs(error(one, name)), abs(error(two, name))) > _NOTABLE
        )
        names = listed([SYMBOLS[name] for name in better[force]]) if better[force] else "none"
        figures.append(f"{force}: nearer and surer for {names} (errors {errors or 'below 0.01 %'})")
    figure = f"One window and two, {'; '.join(figures)}."
    best = max(ALIGNMENTS, key=lambda force: len(better[force]))
    if all(len(names) == len(PARAMETERS) for names in better.values()):
        return REPRODUCED, figure
    if len(better[best]) < 2:
        return NOT, figure
    verdict = f"{REPRODUCED} only if {_WHERE[best]}"
    if len(better[best]) < len(PARAMETERS):
        verdict += f", and then only for {listed([SYMBOLS[name] for name in better[best]])}"
    return verdict, figure


def residual(tables: Tables) -> tuple[str, str]:
    """Verdict and figure: MSE of one window and two."""
    ratio = {
        force: tables["two_windows"][force].mse / tables["one_window"][force].mse
        for force in ALIGNMENTS
    }
    ratios = ", ".join(f"{force} {value:.3g}" for force, value in ratio.items())
    paper = published.TABLES["two_windows"].mse / published.TABLES["one_window"].mse
    verdict = _only({force: value <= 0.6 for force, value in ratio.items()})
    return verdict, f"MSE of two windows over one: {ratios}; paper {paper:.2f}."


def evaluations(tables: Tables) -> tuple[str, str]:
    """Verdict and figure: work of one window and two."""
    fewer = times_fewer(tables)
    counts = []
    for force in ALIGNMENTS:
        one, two = (tables[method][force] for method in METHODS)
        counts.append(
            f"{force} {one.evaluations[0]} against {' + '.join(map(str, two.evaluations))} "
            f"({fewer[force]:.1f} times fewer; "
            f"{_samples(one) / _samples(two):.1f} times fewer samples gone through)"
        )
    figure = (
        f"Evaluations: {', '.join(counts)}; paper 78 against 15 + 12 (2.9). One window needs "
        f"{sum(tables['one_window']['logged'].iterations)} iterations, not 13."
    )
    return _only({force: value >= 2.5 for force, value in fewer.items()}), figure


def _samples(fit: Fit) -> int:
    """Samples that all evaluations have gone through."""
    windows = zip(fit.evaluations, fit.windows, strict=True)
    return sum(count * (last - first) for count, (first, last) in windows)


def attraction(case: Case, runs: int, progress: Callable[[], None]) -> tuple[str, str]:
    """Verdict and figure: spread of C and alpha over runs with encoder noise.

    Spread: half of the range that holds the middle 68 %, over the true value.
    """
    coulomb, _, *others = case.start
    alone = replace(case, slide=(0, 2, ALPHA), start=(coulomb, REFERENCE["attraction"], *others))
    both = replace(case, slide=(0, 1, 2, ALPHA))
    values = []
    for seed in range(runs):
        move = prepare(replace(case, noise=ENCODER_NOISE, seed=seed))
        usual, with_alpha = two_windows(move, case), two_windows(move, alone)
        values.append(
            [
                *(usual.value[name] / REFERENCE[name] for name in PARAMETERS[:3]),
                with_alpha.value["static_ratio"] / published.STATIC_RATIO,
                two_windows(move, both).value["attraction"] / REFERENCE["attraction"],
            ]
        )
        progress()
    low, high = np.percentile(values, [16, 84], axis=0)
    coulomb, rate, viscous, alpha, together = ((high - low) / 2).tolist()
    figure = (
        f"Spread over {runs} runs with {ENCODER_NOISE * 1e9:.0f} nm encoder noise: "
        f"Fc {_percent(coulomb)}, sigma_v {_percent(viscous)}, C {_percent(rate)}; alpha with C "
        f"known {_percent(alpha)}; C with alpha unknown too {_percent(together)}."
    )
    if rate < 10 * max(coulomb, viscous):
        return NOT, figure
    if max(alpha, together) < 0.2:
        return REPRODUCED, figure
    if alpha < 0.2:
        return f"{REPRODUCED} only if C is held while alpha is estimated", figure
    return f"{REPRODUCED} only if nothing is asked of alpha in a single move", figure


def border(case: Case) -> tuple[str, str]:
    """Verdict and figure: sigma0 with the border between the zones moved."""

    def errors(turned: bool, shifts: Sequence[float]) -> dict[float, float]:
        moved = {shift: replace(case, shift=shift, turned=turned) for shift in shifts}
        return {s: error(fit(each, "two_windows"), "stiffness") for s, each in moved.items()}

    def shown(by_shift: dict[float, float]) -> str:
        return ", ".join(f"{_percent(e)} at {s * 1e3:+.0f} ms" for s, e in by_shift.items())

    early, late = (-5e-3, -2e-3, -1e-3), (0.0, 1e-3, 2e-3, 5e-3)
    stuck, slipping = errors(True, (*early, *late)), errors(False, early)
    near = 0.02  # the paper's own error of sigma0 with two windows
    figure = (
        f"Error of sigma0 with the border moved, elements sticking from there on: {shown(stuck)}; "
        f"slipping on until the stage turns back: {shown(slipping)}."
    )
    if max(abs(stuck[shift]) for shift in late[:3]) >= near:
        return NOT, figure
    if max(abs(stuck[shift]) for shift in early) < near:
        return REPRODUCED, figure
    verdict = f"{REPRODUCED} only if zone B begins late rather than early"
    if max(map(abs, slipping.values())) < near:
        verdict += ", or its elements are let slip until the stage turns back"
    return verdict, figure


def robust(case: Case) -> tuple[str, str]:
    """Verdict and figure: effect of an error in one zone's parameters on the other's."""
    move = prepare(case)
    true = np.array([REFERENCE[name] for name in PARAMETERS])
    low, high = (
        zone_a(move, np.array([*case.start[:3], factor * true[3]]), case).value[:3]
        for factor in (0.5, 2.0)
    )
    by_stiffness = float(np.max(np.abs(high / low - 1)))

    def stiffness(known: F64, choice: Case) -> float:
        return float(zone_b(move, known, left_by_zone_a(move, known), choice).value[3])

    wrongs = {"coulomb": 0.001, "attraction": 0.1, "viscous": 0.1}
    handed, estimated = (
        [
            stiffness(np.where([n == name for n in PARAMETERS], true * (1 + by), true), choice)
            / stiffness(true, choice)
            - 1
            for name, by in wrongs.items()
        ]
        for choice in (case, replace(case, initial="free"))
    )
    effects = ", ".join(
        f"{SYMBOLS[name]} wrong by {_percent(by)}: {_percent(taken)} ({_percent(found)})"
        for (name, by), taken, found in zip(wrongs.items(), handed, estimated, strict=True)
    )
    figure = (
        f"sigma0 wrong by a factor 4: Fc, C, sigma_v change by {_percent(by_stiffness)} at most. "
        f"sigma0 in turn, with zone B's initial force taken from zone A (estimated): {effects}."
    )
    if by_stiffness > 1e-3 or abs(handed[0]) <= 10 * wrongs["coulomb"]:
        return NOT, figure
    if max(map(abs, estimated)) > 0.01:
        return REPRODUCED, figure
    return f"{REPRODUCED} only if zone B takes its initial force from zone A", figure


def _percent(share: float) -> str:
    percent = 100 * abs(share)
    sign = "-" if share < 0 else ""
    if percent < 5e-5:
        return "0 %"
    return f"{sign}{percent:.0f} %" if percent >= 99.5 else f"{sign}{percent:.2g} %"
