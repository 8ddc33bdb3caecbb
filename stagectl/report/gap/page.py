"""The page of a gap diagnosis: verdict first, one HTML file that opens offline.

The charts of single moves get plain values, embedded as JSON: series are whole numbers of a step
that suits their size, each the difference to the one before, a quarter of the size of decimals.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import yaml

from hil_sim.settings import StageSettings
from sim2real.attribution import Pairs
from sim2real.diagnosis import Examination
from sim2real.findings import GapReport
from sim2real.gap import Measured, Signals
from sim2real.phases import MoveBlock, split_moves
from sim2real.residuals import ResidualViews
from stagectl.report.chart import legend
from stagectl.report.gap import traces
from stagectl.report.gap.outline import diagnosis_outline
from stagectl.report.gap.views import draw_views
from stagectl.report.render import render_page
from stagedata import F64, AxisSignals, BoolArray, aligned_demand


def render_gap_page(
    report: GapReport,
    examined: Examination,
    machine: str,
    *,
    explained: Sequence[Signals] | None = None,
    similarity: Mapping[str, Pairs] | None = None,
    views: Mapping[str, ResidualViews] | None = None,
) -> str:
    """The page's HTML.

    Args:
        report: of the diagnosis.
        examined: the recordings it is based on; their residuals are drawn.
        machine: name of the machine.
        explained: signals of the model with the causes, one per recording; None without causes.
        similarity: axis -> similarity of pairs of effects.
        views: axis -> what the models leave over velocity, position, frequency, at reversals.
    """
    order = _largest_first(examined)
    axes = {axis.name: axis for axis in examined.settings.axes}
    ratio = examined.settings.control_period / examined.settings.sync_period
    charts = NO_MOVES
    if order:
        charts = move_data(examined.measured, explained, examined.settings, order[0][1])
    shown = [views[axis] for axis in dict.fromkeys(a for _, a, _ in order)] if views else []
    models = ("before", *(("after",) if explained is not None else ()))
    moves = report.next_experiment.recipe()["moves"] if report.next_experiment else ()
    return render_page(
        "gap.html.j2",
        diagnosis_outline(report, machine, examined.measured),
        script="gap.js",
        data=charts,
        explained=explained is not None,
        sections=[
            traces.residual_section(examined.measured, explained, axes[axis], signal, share, ratio)
            for share, axis, signal in order
        ],
        curves=[traces.curve_panel(found, axes[found.axis]) for found in report.unlisted],
        moves=charts,
        views=draw_views(shown),
        move_key=legend("measured", *models),
        model_key=legend(*models),
        residual_key=legend(*models, "floor"),
        matrices={a: _matrix(pairs) for a, pairs in (similarity or {}).items() if pairs},
        next_moves=_yaml(moves),
    )


def _largest_first(examined: Examination) -> list[tuple[float, str, str]]:
    """Share of the gap, axis and signal, the largest share first; empty without measurements."""
    if not examined.measured or examined.located is None:
        return []
    excess = examined.located.excess
    return sorted(
        ((share, a, s) for a, of in excess.items() for s, share in of.items()), reverse=True
    )


def _matrix(pairs: Pairs) -> tuple[list[str], list[list[float | None]]]:
    """Names of effects and the similarity of each with each."""
    known = dict(pairs)
    names = list(dict.fromkeys(name for pair in known for name in pair))
    rows = [[1.0 if a == b else known.get((a, b), known.get((b, a))) for b in names] for a in names]
    return [name.replace("_", " ") for name in names], rows


def _yaml(moves: Sequence[Mapping[str, Any]]) -> str:
    """Moves in the syntax of a recipe."""
    if not moves:
        return ""
    listed = {"moves": [dict(move) for move in moves]}
    text: str = yaml.safe_dump(listed, sort_keys=False, default_flow_style=None)
    return text


_BEFORE = 30
"""Samples shown before a move."""
MAX_VALUES = 150_000
"""Most numbers on a page: about half a megabyte."""
_RESOLVED = 20_000
"""Rounding steps, at least, in the largest value of a series."""


_UNITS = {"force": "N", "error": "µm", "stroke": "mm"}

NO_MOVES: dict[str, Any] = {"axes": [], "moves": [], "every": 1}


def move_data(
    measured: Sequence[Measured],
    explained: Sequence[Signals] | None,
    settings: StageSettings,
    worst_axis: str,
    max_values: int = MAX_VALUES,
) -> dict[str, Any]:
    """All data of the charts of single moves; without `moves` where nothing moves.

    Args:
        measured: the gap of each recording.
        explained: signals of the model with the causes, per recording; None without causes.
        settings: of the machine file.
        worst_axis: the axis to show first, in the move with its largest force residual.
        max_values: most numbers to embed; longer recordings are shown with fewer samples.
    """
    blocks = [(r, b) for r, m in enumerate(measured) for b in _blocks(m)]
    if not blocks:
        return NO_MOVES
    axes = list(measured[0].replay.names)
    ratio = settings.control_period / settings.sync_period
    kinds = ["before"] if explained is None else ["before", "after"]
    samples = sum(b.stop - b.start for _, b in blocks)
    every = max(1, math.ceil(samples * len(axes) * 2 * (1 + len(kinds)) / max_values))
    energies = [_energy(measured[r], b, worst_axis) for r, b in blocks]
    return {
        "axes": axes,
        "units": {
            axis.name: {part: axis.unit_of(unit) for part, unit in _UNITS.items()}
            for axis in settings.axes
        },
        "kinds": kinds,
        "every": every,
        "first": int(np.argmax(energies)),
        "axis": worst_axis,
        "moves": [
            _move(measured[r], None if explained is None else explained[r], b, ratio, every)
            | {"source": measured[r].replay.recording.source if len(measured) > 1 else ""}
            for r, b in blocks
        ],
    }


def _blocks(measured: Measured) -> tuple[MoveBlock, ...]:
    return split_moves(measured.replay.recording, measured.replay.period)


def _energy(measured: Measured, block: MoveBlock, axis: str) -> float:
    """Squared force residual of a move over the squared floor."""
    cut = slice(block.moving, block.end)
    residual = measured.residual[axis]["force"][cut] / (measured.gap[axis]["force"].floor or 1.0)
    return float(np.sum(residual**2))


def _move(
    measured: Measured,
    explained: Mapping[str, Mapping[str, F64]] | None,
    block: MoveBlock,
    ratio: float,
    every: int,
) -> dict[str, Any]:
    first = max(block.moving - _BEFORE, block.start)
    shown = slice(first, block.stop, every)
    period = measured.replay.period
    recorded = measured.replay.recording
    axes = {}
    for name, signals in recorded.axes.items():
        models: dict[str, Mapping[str, F64]] = {"measured": measured.replay.measured()[name]}
        models["before"] = measured.floor.nominal[name]
        if explained is not None:
            models["after"] = explained[name]
        valid = signals.valid[shown]
        axes[name] = {
            "force": _series({k: s["force"][shown] for k, s in models.items()}, valid),
        }
        if "position" in measured.gap[name]:
            axes[name]["error"] = _series(_errors(signals, models, ratio, shown), valid)
    site = recorded.moves[block.number].site if recorded.moves else None
    return {
        "number": block.number + 1,
        "kind": block.kind,
        "site": site,
        "start": round(1e3 * (first - block.moving) * period, 4),
        "step": round(1e3 * every * period, 6),
        "stroke": {
            name: round(1e3 * _stroke(signals, block), 4) for name, signals in recorded.axes.items()
        },
        "axes": axes,
    }


def _stroke(signals: AxisSignals, block: MoveBlock) -> float:
    """How far the axis has gone after the move [m]."""
    position = signals.position_actual
    return float(position[block.end - 1] - position[block.moving])


def _errors(
    signals: AxisSignals, models: Mapping[str, Mapping[str, F64]], ratio: float, shown: slice
) -> dict[str, F64]:
    """Following errors [µm]."""
    demand = aligned_demand(signals, ratio)
    return {
        kind: np.asarray(1e6 * (demand - of["position"])[shown], dtype=np.float64)
        for kind, of in models.items()
    }


def _series(values: Mapping[str, F64], valid: BoolArray) -> dict[str, Any]:
    """Series of one chart in steps of a common size, the simulated ones at missed samples too."""
    largest = max((float(np.abs(v).max()) for v in values.values() if len(v)), default=0.0)
    step = 10.0 ** math.floor(math.log10(largest / _RESOLVED)) if largest > 0.0 else 1.0
    packed: dict[str, Any] = {"step": float(f"{step:.3g}")}
    for kind, series in values.items():
        whole = np.rint(series / step).astype(np.int64)
        packed[kind] = np.diff(whole, prepend=0).tolist()
    if not valid.all():
        packed["missed"] = np.flatnonzero(~valid).tolist()
    return packed
