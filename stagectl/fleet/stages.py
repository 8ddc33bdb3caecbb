"""Results by stage: how large the gap is now, by which effects, and series over time.

What a stage is like now is said by its last recordings together: one of them alone may be odd.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from statistics import median
from typing import Any

import numpy as np

from stagectl.fleet.rows import REFUSED, Row
from stagectl.history import StageKey
from stagedata import F64

LATEST = 5
"""Recordings that say what a stage is like now, the last ones."""
NAMED = 0.5
"""Least probability of a cause that counts."""
_NEVER = datetime(1, 1, 1, tzinfo=UTC)
COULOMB, GAP = "Coulomb force", "gap"


@dataclass(frozen=True, slots=True)
class StageEffect:
    """An effect that most of a stage's last recordings show.

    Attributes:
        axis, effect: as in a diagnosis.
        recordings: of the last ones that show it.
        gap_closed: median share of the gap that it closes; None where it is unknown.
        remedy: what is usually done about it.
    """

    axis: str
    effect: str
    recordings: int
    gap_closed: float | None
    remedy: str


@dataclass(frozen=True, slots=True)
class StageState:
    """A stage of the fleet.

    Attributes:
        key: name and kind.
        recordings: diagnosed.
        last: time of the last one; None where no recording has a time.
        latest: number of those that what follows is of.
        floors: their median gap, in floors; None where none could be measured.
        verdict: the most frequent one of them.
        reason: of the last one with that verdict.
        effects: largest share first.
        channels: faults of channels in the last one.
        attributes: of its machine file and recipe: key -> value.
    """

    key: StageKey
    recordings: int
    last: datetime | None
    latest: int
    floors: float | None
    verdict: str
    reason: str
    effects: tuple[StageEffect, ...]
    channels: tuple[str, ...]
    attributes: Mapping[str, str]


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """A figure of a stage over time, in order.

    Attributes:
        key: the stage.
        axis: "" where it is of the stage.
        figure: `COULOMB` [N] or `GAP` [floors].
        time: [s since 1970], float64[n].
        value: float64[n].
    """

    key: StageKey
    axis: str
    figure: str
    time: F64
    value: F64


def stage_states(rows: Iterable[Row]) -> list[StageState]:
    """All stages, the one with the largest gap first."""
    by_stage: dict[StageKey, list[Row]] = defaultdict(list)
    for row in rows:
        if row["verdict"] != REFUSED:
            by_stage[_key(row)].append(row)
    states = [_state(key, sorted(own, key=_when)) for key, own in by_stage.items()]
    return sorted(states, key=lambda state: (-(state.floors or 0.0), str(state.key)))


def _key(row: Row) -> StageKey:
    return StageKey(row["stage"], bool(row["simulated"]))


def _when(row: Row) -> tuple[datetime, str]:
    return row["started"] or _NEVER, row["recording"]


def _state(key: StageKey, rows: Sequence[Row]) -> StageState:
    latest = rows[-LATEST:]
    ((verdict, _),) = Counter(row["verdict"] for row in reversed(latest)).most_common(1)
    floors = [row["floors"] for row in latest if row["floors"] is not None]
    return StageState(
        key,
        len(rows),
        rows[-1]["started"],
        len(latest),
        median(floors) if floors else None,
        verdict,
        next(row["reason"] for row in reversed(latest) if row["verdict"] == verdict),
        _effects(latest),
        tuple(latest[-1]["channels"]),
        _attributes(latest[-1]),
    )


def _effects(latest: Sequence[Row]) -> tuple[StageEffect, ...]:
    """Those that more than half of the recordings name."""
    named: dict[tuple[str, str], list[Row]] = defaultdict(list)
    for row in latest:
        for cause in row["causes"]:
            if cause["probability"] >= NAMED:
                named[cause["axis"], cause["effect"]].append(cause)
    found = []
    for (axis, effect), causes in named.items():
        if 2 * len(causes) > len(latest):
            shares = [c["gap_closed"] for c in causes if c["gap_closed"] is not None]
            share = median(shares) if shares else None
            found.append(StageEffect(axis, effect, len(causes), share, causes[-1]["remedy"]))
    return tuple(sorted(found, key=lambda e: (-(e.gap_closed or 0.0), e.axis, e.effect)))


def _attributes(row: Row) -> dict[str, str]:
    import yaml

    # Checked by the worker that has diagnosed with it.
    leaves = dict(_leaves(yaml.safe_load(row["machine"]), ""))
    for name in ("recipe", "lot"):
        if row[name] is not None:
            leaves[name] = row[name]
    return leaves


def _leaves(value: Any, key: str) -> Iterable[tuple[str, str]]:
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from _leaves(inner, f"{key}.{name}" if key else str(name))
    elif isinstance(value, list):
        yield key, ", ".join(map(str, value))
    else:
        yield key, str(value)


def series_of(rows: Iterable[Row], friction: Iterable[Row]) -> list[Series]:
    """Gap of each stage and Coulomb force of each axis, where there are times.

    Args:
        rows: results.
        friction: of runs, from a history; it counts once where a recording has it, too.
    """
    points: dict[tuple[StageKey, str, str], dict[int, float]] = defaultdict(dict)
    for row in rows:
        if row["verdict"] == REFUSED or row["started"] is None:
            continue
        at = round(row["started"].timestamp())
        if row["floors"] is not None:
            points[_key(row), "", GAP][at] = row["floors"]
        for of in row["friction"]:
            points[_key(row), of["axis"], COULOMB][at] = of["coulomb"]
    for row in friction:
        at = round(row["started"].timestamp())
        points[_key(row), row["axis"], COULOMB][at] = row["coulomb"]
    return [
        Series(
            *name, np.array(sorted(values), float), np.array([values[t] for t in sorted(values)])
        )
        for name, values in sorted(points.items(), key=lambda item: (str(item[0][0]), item[0][1:]))
    ]
