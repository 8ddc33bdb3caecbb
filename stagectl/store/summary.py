"""`summary.json` of a run, version 1 of docs/formats/run.md.

Built from the recording and the facts of the run. Values that are unknown are null, since JSON has
no NaN; `resumed`, `retries` and the like are present only where they apply.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stagectl.sequencer import WINDOWS, MoveResult, MoveStatistics, statistics, summarise_moves
from stagectl.store.atomic import write_atomically
from stagectl.store.ledger import CycleLedger
from stagedata import Recording

FORMAT = "stagectl-run-summary"
VERSION = 1


@dataclass(frozen=True, slots=True)
class ParameterEstimate:
    """One friction figure with its standard deviation, both in `unit`."""

    value: float
    sigma: float
    unit: str


@dataclass(frozen=True, slots=True)
class FrictionEntry:
    """One friction estimate of one axis at one site.

    Attributes:
        site: from 1, None outside sites.
        axis: its name.
        accepted: whether the model adopted it.
        reason: why not, or None.
        compute_time: of the estimator [s].
        parameters: "coulomb", "viscous", "stiffness", ... -> estimate.
        gain: parameter -> sigma before the move over sigma after it.
        held: parameters kept as they were, for the move says less of them than was known.
    """

    site: int | None
    axis: str
    accepted: bool
    reason: str | None
    compute_time: float
    parameters: Mapping[str, ParameterEstimate]
    gain: Mapping[str, float] = field(default_factory=dict)
    held: Sequence[str] = ()


@dataclass(frozen=True, slots=True)
class Retry:
    """A segment of the recipe that was repeated after a fault.

    Attributes:
        site: from 1, None in a list of moves.
        attempt: from 1.
        fault: its text.
    """

    site: int | None
    attempt: int
    fault: str


@dataclass(frozen=True, slots=True)
class RunFacts:
    """Facts of a run that its samples do not hold.

    Attributes:
        recipe, machine: their names.
        compensation: "none", "model", "estimated" or "oracle".
        seed: of noise and repeatability.
        simulated: on virtual drives.
        lot: or None.
        duration: of the run on the stage's clock [s].
        wall_time: of its moves [s]; nan where the run was killed.
        outcome: "completed", "aborted", "fault" or "killed".
        fault: its text, or None.
        resumed: run, start and progress of the run that this one continues, or None.
        retries: segments that were repeated.
        wafer: or None.
        map: number of the friction map used, or None.  map_comment: what its maker said of it.
        steps: of the friction level, in order of time.
        effects: of the host's machine file: axis, effect, compensated, text.
        unfiled: numbers of estimates in the history and made, where the history lacks some.
        started: ISO 8601 time with zone, or "".
        operator, comment: or None.
        limits: verdicts by the recipe's limits, as in docs/formats/run.md, or None.
        interrupted: where and why it ended early, likewise, or None.
        observer: axis -> whether its force offsets were corrected by an observer, with its gain
            and time constant [s], or the reason why not; empty in a run without.
        watchdog: what the observers' watchdog has found, in order: axis, time [s], out, text.
        feedforward: axis -> what it feeds forward at the end of the run besides the machine file's
            mass, lead and coupling, as in docs/formats/run.md; empty where nothing learns it.
    """

    recipe: str
    machine: str
    compensation: str
    seed: int
    simulated: bool
    lot: str | None
    duration: float
    wall_time: float
    outcome: str
    fault: str | None = None
    resumed: Mapping[str, object] | None = None
    retries: Sequence[Retry] = ()
    wafer: str | None = None
    map: int | None = None
    map_comment: str = ""
    steps: Sequence[Mapping[str, object]] = ()
    effects: Sequence[Mapping[str, object]] = ()
    unfiled: tuple[int, int] | None = None
    started: str = ""
    operator: str | None = None
    comment: str | None = None
    limits: Mapping[str, object] | None = None
    interrupted: Mapping[str, object] | None = None
    observer: Mapping[str, Mapping[str, object]] = field(default_factory=dict)
    feedforward: Mapping[str, Mapping[str, object]] = field(default_factory=dict)
    watchdog: Sequence[Mapping[str, object]] = ()


def build_summary(
    recording: Recording,
    facts: RunFacts,
    friction: Sequence[FrictionEntry],
    *,
    control_period: float,
    sync_period: float,
    ledger: CycleLedger | None = None,
) -> dict[str, Any]:
    """Build the summary as JSON values (long: one key after another).

    Args:
        recording: of the run.
        facts: of the run.
        friction: estimates in order of time.
        control_period: Tc [s].
        sync_period: Ts [s].
        ledger: punctuality; without it, missed TPDOs are counted from `valid`, and late is 0.
    """
    results = summarise_moves(recording, control_period, sync_period, WINDOWS)
    missed = sum(int((~signals.valid).sum()) for signals in recording.axes.values())
    summary: dict[str, Any] = {
        "format": FORMAT,
        "version": VERSION,
        "recipe": facts.recipe,
        "machine": facts.machine,
        "compensation": facts.compensation,
        "seed": facts.seed,
        "simulated": facts.simulated,
        "lot": facts.lot,
        "duration": facts.duration,
        "wall_time": finite(facts.wall_time),
        "outcome": facts.outcome,
        "fault": facts.fault,
        "moves": [_move(result) for result in results],
        "friction": [_friction(entry) for entry in friction],
        "micro": statistics_block(statistics(results, "micro", WINDOWS)),
        "macro": statistics_block(statistics(results, "macro", WINDOWS)),
        "cycle": {
            "period": sync_period,
            "missed": missed if ledger is None else ledger.missed,
            "late": 0 if ledger is None else ledger.late_cycles,
        },
    }
    if ledger is not None:
        summary["punctuality"] = _punctuality(ledger)
    optional = {
        "started": facts.started or None,
        "wafer": facts.wafer,
        "operator": facts.operator,
        "comment": facts.comment,
        "limits": facts.limits,
        "interrupted": facts.interrupted,
        "map": facts.map,
        "map_comment": facts.map_comment or None,
    }
    summary |= {key: value for key, value in optional.items() if value is not None}
    if facts.observer:
        summary["observer"] = {axis: dict(figures) for axis, figures in facts.observer.items()}
    if facts.watchdog:
        summary["watchdog"] = [dict(found) for found in facts.watchdog]
    if facts.feedforward:
        summary["feedforward"] = {axis: dict(of) for axis, of in facts.feedforward.items()}
    if facts.steps:
        summary["steps"] = [dict(step) for step in facts.steps]
    if facts.effects:
        summary["effects"] = [dict(effect) for effect in facts.effects]
    if facts.unfiled is not None:
        summary["history"] = dict(zip(("filed", "estimates"), facts.unfiled, strict=True))
    if facts.resumed is not None:
        summary["resumed"] = dict(facts.resumed)
    if facts.retries:
        summary["retries"] = [asdict(retry) for retry in facts.retries]
    return summary


def _punctuality(ledger: CycleLedger) -> dict[str, Any]:
    """Figures of the cycle ledger; arrival of the TPDOs after SYNC [s] per axis."""
    arrival = {}
    for axis, values in ledger.arrival.items():
        arrived = values[~np.isnan(values)]
        arrival[axis] = {
            name: round(float(np.percentile(arrived, share)), 9) if len(arrived) else None
            for name, share in (("median", 50), ("p99", 99), ("max", 100))
        }
    figures = {
        "tardy": ledger.tardy,
        "doubled": ledger.doubled,
        "late_in_a_row": ledger.late_in_a_row,
        "arrival": arrival,
    }
    if ledger.sync is not None:
        figures["sync_off"] = _off_grid(ledger.sync[~ledger.late])
    return figures


def _off_grid(sync: NDArray[np.float64]) -> dict[str, float | None]:
    """Deviation of SYNCs from their median place on the grid [s]."""
    if not len(sync):
        return {"median": None, "p99": None, "max": None}
    off = np.abs(sync - np.median(sync))
    return {
        name: round(float(np.percentile(off, share)), 9)
        for name, share in (("median", 50), ("p99", 99), ("max", 100))
    }


def write_summary(summary: Mapping[str, Any], path: Path) -> None:
    """Write a summary as JSON, atomically.

    Raises:
        StagectlError: it cannot be written.
    """
    text = json.dumps(summary, indent=1, allow_nan=False) + "\n"
    write_atomically(path, text, "summary")


def window_key(window: float) -> str:
    """A settling window [m] as a key of the summary: 5e-8 -> "5e-08"."""
    return f"{window:.6g}"


def statistics_block(block: MoveStatistics) -> dict[str, Any]:
    """The `micro` or `macro` block of the summary."""
    return {
        "count": block.count,
        "peak_error_median": block.peak_error_median,
        "settling_median": _by_window(block.settling_median),
        "settling_mean": _by_window(block.settling_mean),
        "settling_p90": _by_window(block.settling_p90),
    }


def _by_window(values: Mapping[float, float]) -> dict[str, float]:
    return {window_key(window): round(value, 9) for window, value in values.items()}


def _move(result: MoveResult) -> dict[str, Any]:
    entry: dict[str, Any] = {
        "site": result.site,
        "axis": result.axis,
        "kind": result.kind,
        "distance": result.distance,
        "peak_error": finite(result.peak_error),
        "settling": _by_window(result.settling),
        "settled": result.settled,
    }
    if not result.completed:  # interrupted, and not in the statistics
        entry["completed"] = False
    return entry


def _friction(entry: FrictionEntry) -> dict[str, Any]:
    values = asdict(entry)
    values["compute_time"] = finite(entry.compute_time)
    values["gain"] = {name: finite(gain) for name, gain in entry.gain.items()}
    values["held"] = list(entry.held)
    for parameter in values["parameters"].values():
        parameter["value"] = finite(parameter["value"])
        parameter["sigma"] = finite(parameter["sigma"])
    return values


def finite(value: float) -> float | None:
    """A number as JSON has it: null where it is not finite."""
    return float(value) if math.isfinite(value) else None
