"""What the samples of a run say in its `summary.json`: moves, their statistics, punctuality.

Version 1 of docs/formats/run.md. Values that are unknown are null, since JSON has no NaN. What a
run has noted besides its samples: `run.recorded.summarise`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from stagectl.sequencer import MoveResult, MoveStatistics, statistics, summarise_moves
from stagectl.store.cycle_ledger import CycleLedger
from stagedata import F64, Recording

_SHARES = {"median": 50, "p99": 99, "max": 100}


def summarise_samples(
    recording: Recording,
    control_period: float,
    sync_period: float,
    ledger: CycleLedger | None = None,
) -> dict[str, Any]:
    """The keys `moves`, `micro`, `macro`, `cycle` and, with a ledger, `punctuality`.

    Args:
        recording: of the run.
        control_period: Tc [s].
        sync_period: Ts [s].
        ledger: punctuality; without it, missed TPDOs are counted from `valid`, and late is 0.
    """
    results = summarise_moves(recording, control_period, sync_period)
    missed = sum(int((~signals.valid).sum()) for signals in recording.axes.values())
    found: dict[str, Any] = {
        "moves": [_move(result) for result in results],
        "micro": statistics_block(statistics(results, "micro")),
        "macro": statistics_block(statistics(results, "macro")),
        "cycle": {
            "period": sync_period,
            "missed": missed if ledger is None else int(ledger.missed_per_cycle.sum()),
            "late": 0 if ledger is None else int(ledger.late.sum()),
        },
    }
    if ledger is not None:
        found["punctuality"] = _punctuality(ledger)
    return found


def _punctuality(ledger: CycleLedger) -> dict[str, Any]:
    """Figures of the cycle ledger; arrival of the TPDOs after SYNC [s] per axis."""
    figures = {
        "tardy": int(ledger.tardy_per_cycle.sum()),
        "doubled": int(ledger.doubled_per_cycle.sum()),
        "late_in_a_row": ledger.late_in_a_row,
        "arrival": {
            axis: _spread(values[~np.isnan(values)]) for axis, values in ledger.arrival.items()
        },
    }
    if ledger.sync is not None:  # deviation of SYNCs from their median place on the grid [s]
        sync = ledger.sync[~ledger.late]
        figures["sync_off"] = _spread(np.abs(sync - np.median(sync)) if len(sync) else sync)
    return figures


def _spread(values: F64) -> dict[str, float | None]:
    return {
        name: round(float(np.percentile(values, share)), 9) if len(values) else None
        for name, share in _SHARES.items()
    }


def statistics_block(block: MoveStatistics) -> dict[str, Any]:
    """The `micro` or `macro` block of the summary."""
    return {
        name: _by_window(value) if isinstance(value, Mapping) else value
        for name, value in asdict(block).items()
    }


def _by_window(values: Mapping[float, float]) -> dict[str, float]:
    """Windows [m] as keys: 5e-8 -> "5e-08"."""
    return {f"{window:.6g}": round(value, 9) for window, value in values.items()}


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


def finite(value: float | None) -> float | None:
    """A number, of any unit, as JSON has it: null where it is unknown or not finite."""
    return None if value is None or not math.isfinite(value) else float(value)
