"""Which sites are due: by age, moves, distance, change seen in production, or uncertainty.

In a production run they are slipped in, the most urgent first, within a time budget. A calibration
of due sites alone has to make a map, together with what the history knows.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from scipy.spatial import cKDTree

from estimation.trajectory import Limits
from estimation.trajectory import plan as motion
from stagectl.calibration.sequence import REST, SiteSequence
from stagectl.calibration.sites import DAY, Calibration, DueSection
from stagectl.errors import UnusableInput
from stagectl.history import History, Pair, StageKey, StepRecord, Wear, existing_history
from stagectl.maps import LEAST_SITES, SITE_RADIUS, PlaceIndex, TrackedPlaces, load_active
from stagectl.recipe import Recipe
from stagectl.run import RunRequest, stage_key, start_time

NEVER = "never calibrated"


@dataclass(frozen=True, slots=True)
class DueSite:
    """A site that should be calibrated.

    Attributes:
        place: [m].
        reasons: limits that are exceeded, the worst first.
        urgency: multiple of the worst limit.
    """

    place: Pair
    reasons: tuple[str, ...]
    urgency: float


def due_sites(
    sites: Sequence[Pair],
    limits: DueSection,
    history: History,
    stage: StageKey,
    axes: Sequence[str],
    now: float,
    places: TrackedPlaces | None,
) -> list[DueSite]:
    """The due ones among `sites`, the most urgent first.

    Args:
        sites: of the calibration [m].
        limits: when a site is due.
        history: open.
        stage: that is calibrated.
        axes: names.
        now: [s since 1970].
        places: the active map, brought up to date, or None.
    """
    calibrated = history.calibrated(stage)
    index = PlaceIndex(SITE_RADIUS, (place for place, _ in calibrated))
    last = {
        site: max((calibrated[number][1] for number in index.near(site)), default=None)
        for site in sites
    }
    starts = sorted({when for when in last.values() if when is not None}, reverse=True)
    worn = _worn(history, stage, axes, starts)
    steps = history.steps(stage, starts[-1]) if starts else []
    found = [
        DueSite(site, (NEVER,), math.inf)
        if when is None
        else _due(site, when, limits, worn[when], [s for s in steps if s.time > when], now, places)
        for site, when in last.items()
    ]
    return sorted((d for d in found if d.reasons), key=lambda d: -d.urgency)


def _worn(
    history: History, stage: StageKey, axes: Sequence[str], starts: Sequence[float]
) -> dict[float, dict[str, Wear]]:
    """Moves and distance of every axis since each of these times, the latest first.

    Every move is read once, however many sites there are.
    """
    found: dict[float, dict[str, Wear]] = {}
    total = dict.fromkeys(axes, Wear(0, 0.0))
    until = math.inf
    for begin in starts:
        for axis in axes:
            more = history.wear(stage, axis, begin, until)
            known = total[axis]
            total[axis] = Wear(known.moves + more.moves, known.distance + more.distance)
        found[begin], until = dict(total), begin
    return found


def _due(
    site: Pair, when: float, limits: DueSection, worn: Mapping[str, Wear],
    steps: Sequence[StepRecord], now: float, places: TrackedPlaces | None,
) -> DueSite:  # fmt: skip
    """A site calibrated at `when`, with wear and steps since then."""
    passed: list[tuple[float, str]] = []

    def check(value: float, limit: float, text: str) -> None:
        if value >= limit:
            passed.append((value / limit, text))

    days = (now - when) / DAY
    check(days, limits.days, f"calibrated {days:.3g} days ago")
    for axis, done in worn.items():
        check(done.moves, limits.moves, f"{axis}: {done.moves} moves since")
        check(done.distance, limits.distance, f"{axis}: {done.distance:.3g} m travelled since")
    for step in steps:
        if step.kind == "common" or math.dist(step.place, site) <= SITE_RADIUS:
            urgency = 1.0 + abs(step.change) / limits.change
            passed.append((urgency, f"{step.axis}: stepped by {100 * step.change:+.0f} % since"))
    if places is not None:
        for axis, tracker in places.trackers.items():
            number = places.number_of(site)
            if number is None:
                continue
            tracker.advance(now)
            change, sigma = tracker.off_map(number)
            if abs(change) > 2.0 * sigma:
                check(
                    abs(math.expm1(change)),
                    limits.change,
                    f"{axis}: {100 * change:+.1f} % off the map",
                )
            check(sigma, limits.uncertainty, f"{axis}: uncertain by {100 * sigma:.1f} % here")
    passed.sort(reverse=True)
    return DueSite(site, tuple(text for _, text in passed), passed[0][0] if passed else 0.0)


def due_now(calibration: Calibration, request: RunRequest) -> list[DueSite]:
    """The due sites of a calibration when a run begins: all of them, where there is no history yet.

    Raises:
        StagectlError: the history cannot be used, or its active map does not fit.
    """
    machine, sites, stage = request.machine, calibration.recipe.sites, stage_key(request)
    with existing_history(request.history) as history:
        if history is None:
            return [DueSite(site, (NEVER,), math.inf) for site in sites]
        now = start_time(history, request)
        active = load_active(history, stage, machine, sites, now)
        return due_sites(
            sites, calibration.due, history, stage, tuple(machine.axes), now,
            None if active is None else active.places,
        )  # fmt: skip


def insert_sites(
    recipe: Recipe, due: Sequence[DueSite], sequence: SiteSequence, budget: float
) -> tuple[Recipe, float]:
    """The recipe with calibration sites inserted, and the time they take [s].

    Each comes after the production site nearest to it. Its cost is the detour, the sequence and the
    rests.

    Args:
        recipe: of production, with sites.
        due: the most urgent first.
        sequence: of moves at each.
        budget: of time for all of them [s].
    """
    slipped: list[tuple[int, Pair]] = []
    spent = 0.0
    nearest = cKDTree(recipe.sites).query([site.place for site in due])[1] if due else []
    for site, found in zip(due, nearest, strict=True):
        behind = int(found)
        ahead = recipe.sites[min(behind + 1, len(recipe.sites) - 1)]
        here = recipe.sites[behind]
        detour = _time(recipe, here, site.place) + _time(recipe, site.place, ahead)
        cost = max(detour - _time(recipe, here, ahead), 0.0) + sequence.duration + REST
        if spent + cost <= budget:
            slipped.append((behind + 1, site.place))
            spent += cost
    if not slipped:
        return recipe, 0.0
    made = replace(recipe, slipped=tuple(slipped), slipped_excursions=sequence.excursions)
    return made, spent


def _time(recipe: Recipe, begin: Pair, end: Pair) -> float:
    """Of a macro-move with its rest [s]."""
    profile = recipe.macro
    limits = Limits(profile.velocity, profile.acceleration, profile.jerk)
    return max(motion(a, b, limits).duration for a, b in zip(begin, end, strict=True)) + REST


def require_enough_sites(request: RunRequest, sites: Sequence[Pair]) -> None:
    """Refuse sites that make no map, together with the places that the history knows.

    Args:
        request: with machine and history.
        sites: to be visited [m].

    Raises:
        UnusableInput: they are too few.
        StagectlError: the history cannot be used.
    """
    with existing_history(request.history) as history:
        known = [] if history is None else history.places(stage_key(request))
    places = PlaceIndex(SITE_RADIUS)
    count = 0
    for place in (*known, *sites):
        if not places.near(place):
            places.add(place)
            count += 1
    if count < LEAST_SITES:
        raise UnusableInput(
            f"{request.recipe.source}: sites: {count} make no map, those in the history included; "
            f"it takes {LEAST_SITES}, more than {SITE_RADIUS * 1e3:g} mm apart"
        )
