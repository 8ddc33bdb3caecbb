"""Peak error and settling time of recorded moves, as defined in docs/formats/run.md.

Positions are the encoder's. Errors are taken against d_k = r_{k-1} + (r_k - r_{k-1}) Tc/Ts, the
demand inside the drive when sample k is taken. Samples without a TPDO (`valid` false) are left out
of every maximum and comparison. A site passes or fails by the recipe's `limits`, judged on its
micro-move; one without (no fiducial) on its macro-move.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from stagectl.recipe import SiteLimits
from stagedata import F64, Recording, aligned_demand

BoolArray = npt.NDArray[np.bool_]

WINDOWS = (5e-8, 2e-7)
RESOLUTION = 1e-9
"""Of setpoints on the bus [m]; what is shorter is no move."""

# Rounded to the resolution, the demand ends within half of it from its target.
_ARRIVED = 0.5 * RESOLUTION + 1e-12


@dataclass(frozen=True, slots=True)
class MoveResult:
    """Peak error and settling of one axis in one move.

    Attributes:
        move: number of the move in the recording, from 0.
        site: from 1, or None.
        axis: its name.
        kind: of the move.
        distance: |to - from| [m].
        peak_error: largest |d_k - position| while the demand moves [m]; nan where every sample of
            the motion is invalid.
        settling: window [m] -> settling time [s].
        settled: inside the tightest window at its last sample.
        completed: the demand reached its target; false for an interrupted move.
    """

    move: int
    site: int | None
    axis: str
    kind: str
    distance: float
    peak_error: float
    settling: Mapping[float, float]
    settled: bool
    completed: bool


@dataclass(frozen=True, slots=True)
class MoveStatistics:
    """Statistics over the entries of one kind of move, both axes together.

    Attributes:
        count: entries (one per move and axis that moves).
        peak_error_median: [m], None without entries.
        settling_median, settling_mean, settling_p90: window [m] -> [s]; p90 is the 90th
            percentile, interpolated linearly.
    """

    count: int
    peak_error_median: float | None
    settling_median: Mapping[float, float]
    settling_mean: Mapping[float, float]
    settling_p90: Mapping[float, float]


def arrival(demand: F64, target: float, start: int, end: int) -> int | None:
    """First sample in [start, end) whose aligned demand is the target.

    The demand inside the drive runs from r_{k-1} to r_k, so it is the target at sample k when both
    are; positions go over the bus in steps of `RESOLUTION`, so half a step is no difference.

    Args:
        demand: float64[K], position demand r_k as sent [m].
        target: [m].
        start: first sample of the move.
        end: one past the last sample to look at.
    """
    there = np.abs(demand[max(start - 1, 0) : end] - target) <= _ARRIVED
    if start == 0:  # r_{-1} = r_0
        there = np.concatenate((there[:1], there))
    found = np.flatnonzero(there[1:] & there[:-1])
    return start + int(found[0]) if len(found) else None


def peak_error(position: F64, aligned: F64, valid: BoolArray, start: int, end: int) -> float:
    """Largest |d_k - position| in [start, end) [m]; nan where no sample there is valid.

    Args:
        position: float64[K], position actual [m].
        aligned: float64[K], aligned demand d_k [m].
        valid: bool[K].
        start: first sample of the demand's motion.
        end: one past its last.
    """
    error = np.abs(aligned[start:end] - position[start:end])[valid[start:end]]
    return float(error.max()) if len(error) else float("nan")


def settling(
    position: F64,
    valid: BoolArray,
    target: float,
    arrived: int,
    end: int,
    window: float,
    period: float,
) -> tuple[float, bool]:
    """Settling time to +-window.

    (j + 1 - arrived) period, where j is the last sample in [arrived, end) outside the window; 0
    where there is none. A move still outside at its last sample counts with the whole time.

    Args:
        position: float64[K], position actual [m].
        valid: bool[K].
        target: [m].
        arrived: first sample whose aligned demand is the target.
        end: one past the last sample of the rest: the start of the next move, or K.
        window: half width w [m].
        period: Ts [s].

    Returns:
        (time [s], whether it settled).
    """
    measured = np.flatnonzero(valid[arrived:end])
    if len(measured) == 0:
        return _seconds(end - arrived, period), False
    outside = np.abs(position[arrived:end][measured] - target) > window
    if outside[-1]:
        return _seconds(end - arrived, period), False
    last = np.flatnonzero(outside)
    return (_seconds(int(measured[last[-1]]) + 1, period) if len(last) else 0.0), True


def _seconds(samples: int, period: float) -> float:
    return round(samples * period, 12)  # 7 periods are 0.007, not 0.007000000000000001


def summarise_moves(
    recording: Recording,
    control_period: float,
    sync_period: float,
    windows: Sequence[float] = WINDOWS,
) -> list[MoveResult]:
    """One entry per move and axis that moves, in the order of the recording.

    Args:
        recording: of a run.
        control_period: Tc [s].
        sync_period: Ts [s].
        windows: half widths [m], at least one.
    """
    aligned = {
        name: aligned_demand(signals, control_period / sync_period)
        for name, signals in recording.axes.items()
    }
    results: list[MoveResult] = []
    for number, move in enumerate(recording.moves):
        end = recording.rest_end(number)
        for name, signals in recording.axes.items():
            if abs(move.distance(name)) >= RESOLUTION:
                target = move.target[name]
                arrived = arrival(signals.position_demand, target, move.start, end)
                # An interrupted move has no arrival: its rest begins where the demand stopped.
                rest = min(move.end, end) if arrived is None else arrived
                position, valid = signals.position_actual, signals.valid
                times = {
                    window: settling(position, valid, target, rest, end, window, sync_period)
                    for window in windows
                }
                results.append(
                    MoveResult(
                        move=number,
                        site=move.site,
                        axis=name,
                        kind=move.kind,
                        distance=abs(move.distance(name)),
                        peak_error=peak_error(position, aligned[name], valid, move.start, rest),
                        settling={window: seconds for window, (seconds, _) in times.items()},
                        settled=times[min(windows)][1],
                        completed=arrived is not None,
                    )
                )
    return results


def statistics(results: Iterable[MoveResult], kind: str) -> MoveStatistics:
    """Statistics over the completed moves of one kind ("macro", "micro", ...), axes together."""
    chosen = [r for r in results if r.kind == kind and r.completed]
    if not chosen:
        return MoveStatistics(0, None, {}, {}, {})
    times = {w: np.array([r.settling[w] for r in chosen]) for w in chosen[0].settling}
    peaks = [r.peak_error for r in chosen if np.isfinite(r.peak_error)]
    return MoveStatistics(
        count=len(chosen),
        peak_error_median=float(np.median(peaks)) if peaks else None,
        settling_median={w: float(np.median(t)) for w, t in times.items()},
        settling_mean={w: float(np.mean(t)) for w, t in times.items()},
        settling_p90={w: float(np.quantile(t, 0.9)) for w, t in times.items()},
    )


@dataclass(frozen=True, slots=True)
class SiteVerdict:
    """One site; `failures` names what exceeded its limit, and is empty for a pass."""

    site: int
    failures: tuple[str, ...]


def judge(
    recording: Recording,
    limits: SiteLimits,
    window: float,
    control_period: float,
    sync_period: float,
) -> tuple[SiteVerdict, ...]:
    """Verdicts of all sites in the order of their visit; none where the recipe has no limits.

    A site that was repeated after a fault is judged on its last visit.

    Args:
        recording: of the run.
        limits: longest settling [s] to `window` and largest peak error [m].
        window: the recipe's settle window [m].
        control_period: Tc [s].
        sync_period: Ts [s].
    """
    if limits.settling is None and limits.peak_error is None:
        return ()
    results = summarise_moves(recording, control_period, sync_period, (window,))
    visits = {}
    for number, move in enumerate(recording.moves):
        if move.site is not None and (move.kind == "macro" or move.site not in visits):
            visits[move.site] = number
    sites: dict[int, list[MoveResult]] = {site: [] for site in visits}
    for result in results:
        if result.site is not None and result.move >= visits[result.site]:
            sites[result.site].append(result)
    return tuple(SiteVerdict(site, _failures(of, limits, window)) for site, of in sites.items())


def _failures(results: Sequence[MoveResult], limits: SiteLimits, window: float) -> tuple[str, ...]:
    judged = [r for r in results if r.kind == "micro"] or results
    failures = []
    for result in judged:
        time, error = result.settling[window], result.peak_error
        if limits.settling is not None and not (result.settled and time <= limits.settling):
            failures.append(
                f"{result.axis} settled in {time * 1e3:.0f} ms, limit {limits.settling * 1e3:g} ms"
                if result.settled
                else f"{result.axis} did not settle"
            )
        if limits.peak_error is not None and (math.isnan(error) or error > limits.peak_error):
            failures.append(
                f"{result.axis} peak error {error * 1e6:.3f} µm, "
                f"limit {limits.peak_error * 1e6:g} µm"
            )
    return tuple(failures)
