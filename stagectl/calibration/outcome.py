"""Results of a calibration, site by site: level, change, information gained, and what to do."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any, TypeVar

from stagectl.calibration.sequence import START, Gain, SiteSequence
from stagectl.history import Pair
from stagectl.maps import AxisChange, FrictionMap, MapSite, PlaceIndex, SiteChange

Site = TypeVar("Site", MapSite, SiteChange)

WATCH, ACT = 0.03, 0.10
"""Relative change of a site, beside the common change, to watch or to act on."""
COMMON_ACT = 0.25
"""Likewise for the common change."""
FEWEST = 3
"""Sites that have to be measured to tell a change of the whole table from their own."""
SAME = 1e-6
"""Places this near are the same site [m]: the history keeps whole micrometres."""


@dataclass(frozen=True, slots=True)
class SiteOutcome:
    """One axis at one site.

    Attributes:
        site: number in the calibration.
        place: [m].
        axis: its name.
        coulomb: [N]; None where no estimate was accepted.
        sigma: its relative standard deviation.
        change: relative, since the previous map, beside the common change; None without one.
        gains: figure -> gain reached.
        refused: reasons of refused estimates.
        severity: "good", "watch", "act" or "failed".
        suggestion: one sentence.
    """

    site: int
    place: Pair
    axis: str
    coulomb: float | None
    sigma: float | None
    change: float | None
    gains: Mapping[str, Gain]
    refused: tuple[str, ...]
    severity: str
    suggestion: str


def site_outcomes(
    sites: Sequence[Pair],
    friction: Sequence[Mapping[str, Any]],
    axes: Sequence[str],
    built: FrictionMap | None,
    changes: Sequence[AxisChange],
) -> list[SiteOutcome]:
    """One outcome per site and axis.

    Args:
        sites: visited [m], in order.
        friction: entries of the run's summary.
        axes: names.
        built: the new map; None where none could be built.
        changes: since the previous version; empty without one.
    """
    found = []
    seen: set[Pair] = set()
    entries: dict[tuple[int, str], list[Mapping[str, Any]]] = {}
    for entry in friction:
        entries.setdefault((entry["site"], entry["axis"]), []).append(entry)
    levels = {} if built is None else {n: _by_place(axis.sites) for n, axis in built.axes.items()}
    moved = {change.axis: _by_place(change.sites) for change in changes}
    for number, place in enumerate(sites, 1):
        if place in seen:
            continue  # the first one again, to see drift
        seen.add(place)
        for axis in axes:
            level = levels[axis](place) if axis in levels else None
            change = moved[axis](place) if axis in moved else None
            mine = entries.get((number, axis), [])
            found.append(_outcome(number, place, axis, mine, level, change))
    return found


def _by_place(items: Sequence[Site]) -> Callable[[Pair], Site | None]:
    """Finds what is known of a site by its place."""
    index = PlaceIndex(SAME, (item.place for item in items))
    return lambda place: next((items[number] for number in index.near(place)), None)


def visited_sites(
    sites: tuple[Pair, ...], friction: Sequence[Mapping[str, Any]]
) -> tuple[Pair, ...]:
    """The sites reached: up to the last one with an estimate, even a refused one."""
    last: int = max((entry["site"] or 0 for entry in friction), default=0)
    return sites[:last]


def _outcome(
    number: int,
    place: Pair,
    axis: str,
    entries: Sequence[Mapping[str, Any]],
    level: MapSite | None,
    change: SiteChange | None,
) -> SiteOutcome:
    """One axis at one site; without a map its level is that of the last accepted estimate."""
    accepted = [e for e in entries if e["accepted"]]
    refused = tuple(str(e["reason"]) for e in entries if not e["accepted"])
    gains: dict[str, Gain] = {}
    coulomb = sigma = None
    if accepted:
        coulomb, sigma = _level(accepted[-1]["parameters"])
        known = _known(accepted[-1]["parameters"])
        gains = {name: Gain(START[name], known[name]) for name in START if known.get(name)}
    if level is not None:
        coulomb, sigma = level.coulomb, level.sigma
    severity, suggestion = _judged(accepted, refused, change)
    return SiteOutcome(
        number, place, axis, coulomb, sigma,
        None if change is None else change.change,
        gains, refused, severity, suggestion,
    )  # fmt: skip


def _level(figures: Mapping[str, Mapping[str, Any]]) -> tuple[float | None, float | None]:
    """The Coulomb force [N] and its relative standard deviation."""
    figure = figures.get("coulomb")
    if figure is None or not figure["value"]:
        return None, None
    return figure["value"], figure["sigma"] / figure["value"]


def _known(figures: Mapping[str, Mapping[str, Any]]) -> dict[str, float]:
    """Relative standard deviations; that of C/Fc from those of C and Fc."""
    known = {
        name: figure["sigma"] / figure["value"]
        for name, figure in figures.items()
        if figure["value"] and figure["sigma"]
    }
    if "attraction" in known and "coulomb" in known:
        rest = known.pop("attraction") ** 2 - known["coulomb"] ** 2
        known["relaxation_rate"] = math.sqrt(max(rest, 0.0))
    return known


def _judged(
    accepted: Sequence[object],
    refused: tuple[str, ...],
    change: SiteChange | None,
) -> tuple[str, str]:
    if not accepted:
        reason = refused[-1] if refused else "no estimate"
        return "failed", f"calibrate again; {reason}"
    if len(refused) > len(accepted):
        return "watch", f"more moves refused than accepted ({refused[-1]}): calibrate again"
    if change is None:
        return "good", "not compared: no earlier map of this site"
    size = abs(change.change) if change.significant else 0.0
    if size >= ACT:
        dirty = change.change > 0
        what = "dirt, a rubbing cable or a damaged rail there" if dirty else "grease there"
        return "act", f"look for {what}; then calibrate the site again"
    if size >= WATCH:
        return "watch", "activate the new map; calibrate the site again soon"
    return "good", "nothing to do"


def common_changes(changes: Sequence[AxisChange], outcomes: Sequence[SiteOutcome]) -> list[str]:
    """Change of the whole table and what to do about it, one line per axis."""
    lines = []
    for entry in changes:
        measured = sum(o.axis == entry.axis and o.coulomb is not None for o in outcomes)
        if measured < FEWEST:
            lines.append(
                f"axis {entry.axis}: {measured} site{'s' * (measured != 1)} measured; whether all "
                f"sites have changed shows when at least {FEWEST} are"
            )
            continue
        text = f"axis {entry.axis}: all sites {100 * entry.common:+.1f} % since the last map"
        if abs(entry.common) >= COMMON_ACT:
            text += ": look at lubrication, wipers and temperature"
        elif abs(entry.common) >= WATCH:
            text += ": warm-up or ageing; the tracking follows it"
        lines.append(text)
    return lines


def reached_gains(found: Sequence[SiteOutcome], sequence: SiteSequence) -> list[str]:
    """Gains reached and predicted, medians over the sites, one line per axis."""
    lines = []
    for axis, expected in sequence.gains.items():
        parts = []
        for name, gain in expected.items():
            mine = [o.gains[name] for o in found if o.axis == axis and name in o.gains]
            if mine:
                parts.append(
                    f"{name} {100 * median(g.after for g in mine):.1f} % "
                    f"({median(g.bits for g in mine):.1f} bit of {gain.bits:.1f})"
                )
        if parts:
            lines.append(f"axis {axis}: {', '.join(parts)}")
    return lines


def predicted_gains(sequence: SiteSequence) -> list[str]:
    """Predicted gains at a site, one line per axis."""
    return [
        f"axis {axis}: " + ", ".join(
            f"{name} {100 * gain.after:.1f} % ({gain.bits:.1f} bit)" for name, gain in gains.items()
        )
        for axis, gains in sequence.gains.items()
    ]  # fmt: skip
