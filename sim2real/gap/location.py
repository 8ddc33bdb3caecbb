"""Where the gap lies: its energy above the floor by axis, phase, position, velocity, and so on.

Energy is squared residual over squared floor, so that positions and forces add up; the energy of
the model's own noisy draws in the same cell is subtracted. Over position, velocity, time and
frequency the cell is the range whose energy most exceeds that of an even spread. A cell is
reported where it holds more than its share of the samples.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim2real.findings import Where
from sim2real.gap.measure import Measured
from sim2real.phases import PHASES, REST, SETTLING, split_moves, split_phases
from sim2real.waves import wave_sums
from stagedata import FloatArray, aligned_demand, angular_unit

BINS = 24
SMALLEST_SHARE = 0.05
"""Smallest share of the gap's energy for which a cell is reported."""
_LIFT = 1.3
"""Least ratio of a cell's share of the energy to its share of the samples."""
_MOST = 16
_SPATIAL = np.arange(10.0, 1001.0)
"""Spatial frequencies examined [1/m]: pitches from 1 to 100 mm."""
_MOVING = 0.01
_BANDS = np.geomspace(2.0, 500.0, 25)

Weights = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Located:
    """Where a gap lies.

    Attributes:
        cells: those that hold most of it, largest first.
        excess: axis -> signal -> share of all energy above the floor, 0..1.
    """

    cells: tuple[Where, ...]
    excess: dict[str, dict[str, float]]


@dataclass(frozen=True, slots=True, eq=False)
class _Signal:
    """Residual of one signal of one axis over all recordings, K samples, and what it is cut by.

    Attributes:
        energy: (residual/floor)^2 less that of the draws, 0 where invalid, float64[K].
        residual: recorded minus simulated, float64[K] [m or N].
        draws: noisy runs less the noise-free one, float64[D, K] [m or N].
        floor: [m or N].
        valid: bool[K].
        period: of the samples [s].
        starts: first sample of each recording.
        position, velocity, time: of the demand, float64[K] [m, m/s, s].
        travelled: position actual, float64[K] [m].
        phase, direction, move: int[K].
        turns: whether the axis turns, with rad for m.
    """

    axis: str
    signal: str
    energy: Weights
    residual: FloatArray
    draws: FloatArray
    floor: float
    valid: NDArray[np.bool_]
    period: float
    starts: tuple[int, ...]
    position: FloatArray
    travelled: FloatArray
    velocity: FloatArray
    time: FloatArray
    phase: NDArray[np.int8]
    direction: NDArray[np.int8]
    move: NDArray[np.int64]
    turns: bool

    def unit(self, unit: str) -> str:
        """The unit on this axis of what has `unit` on an axis that slides."""
        return angular_unit(unit) if self.turns else unit


def locate_gap(measured: Sequence[Measured], ratio: float = 0.1) -> Located:
    """Where the gap of a model against recordings of one stage lies.

    Args:
        measured: of each recording; the residual may be that of any model.
        ratio: Tc/Ts, control period over SYNC period.
    """
    signals = [
        _gathered(measured, axis, signal, ratio)
        for axis, figures in measured[0].gap.items()
        for signal in figures
    ]
    total = sum(max(float(s.energy.sum()), 0.0) for s in signals)
    excess: dict[str, dict[str, float]] = {}
    cells: list[Where] = []
    for s in signals:
        share = max(float(s.energy.sum()), 0.0) / total if total > 0 else 0.0
        excess.setdefault(s.axis, {})[s.signal] = share
        if share < SMALLEST_SHARE:
            continue
        text = f"{s.axis}: {_percent(share)} of the gap is in the {s.signal}"
        cells.append(Where(s.axis, s.signal, "axis", share, text=text))
        for cut in (_phases, _directions, _moves, _ranges, _frequencies, _pitches):
            cells += cut(s, total)
    kept = sorted((c for c in cells if c.share >= SMALLEST_SHARE), key=lambda c: -c.share)
    return Located(tuple(kept[:_MOST]), excess)


def _gathered(measured: Sequence[Measured], axis: str, signal: str, ratio: float) -> _Signal:
    parts: dict[str, list[NDArray[np.generic]]] = {}
    starts, count, moves = [], 0, 0
    floor = float(np.sqrt(np.mean([m.gap[axis][signal].floor ** 2 for m in measured])))
    for m in measured:
        signals = m.replay.recording.axes[axis]
        demand = aligned_demand(signals, ratio)
        phases = split_phases(signals.position_demand, m.replay.period)
        of_move = np.zeros(len(demand), dtype=np.int64)
        found = split_moves(m.replay.recording, m.replay.period)
        for block in found:
            of_move[block.start : block.stop] = moves + block.number
        moves += len(found)
        drawn = np.stack([draw[axis][signal] for draw in m.floor.draws])
        for name, values in (
            ("residual", m.residual[axis][signal]), ("draws", drawn), ("valid", signals.valid),
            ("position", demand), ("travelled", signals.position_actual),
            ("velocity", phases.velocity), ("phase", phases.phase),
            ("time", m.replay.place * m.replay.period), ("direction", phases.direction),
            ("move", of_move),
        ):  # fmt: skip
            parts.setdefault(name, []).append(values)
        starts.append(count)
        count += len(demand)
    joined = {name: np.concatenate(values, axis=-1) for name, values in parts.items()}
    scale = 1.0 / floor**2 if floor > 0 else 1.0
    noise = np.mean(np.square(joined["draws"].astype(np.float64)), axis=0)
    energy = np.where(joined["valid"], np.square(joined["residual"].astype(float)) - noise, 0.0)
    return _Signal(
        axis=axis, signal=signal, energy=scale * energy, floor=floor,
        period=measured[0].replay.period, starts=tuple(starts),
        turns=measured[0].gap[axis][signal].unit in ("rad", "N m"), **joined,
    )  # fmt: skip


def _cell(
    s: _Signal, by: str, inside: NDArray[np.bool_], total: float, words: str, **place: object
) -> list[Where]:
    """The cell of these samples, where it holds more than its share of the samples."""
    share = float(s.energy[inside].sum()) / total
    own = max(float(s.energy.sum()), 1e-300)
    samples = float(inside[s.valid].sum() / max(s.valid.sum(), 1))
    if share < SMALLEST_SHARE or share * total / own < _LIFT * samples:
        return []
    when = f"({_percent(samples)} of the time)"
    text = f"{s.axis} {s.signal}: {_percent(share)} of the gap {words} {when}"
    return [Where(s.axis, s.signal, by, min(share, 1.0), text=text, **place)]  # type: ignore[arg-type]


def _phases(s: _Signal, total: float) -> list[Where]:
    words = {"rest": "at rest", "micro": "in micro-moves", "settling": "while settling"}
    return [
        cell
        for number, name in enumerate(PHASES)
        for cell in _cell(
            s, "phase", s.phase == number, total, words.get(name, f"in {name}"), value=name
        )
    ]


def _directions(s: _Signal, total: float) -> list[Where]:
    names = {-1: "in backward motion", 1: "in forward motion"}
    return [
        cell
        for number, name in names.items()
        for cell in _cell(s, "direction", s.direction == number, total, name, value=number)
    ]


def _moves(s: _Signal, total: float) -> list[Where]:
    sums = np.bincount(s.move, weights=s.energy)
    best = int(np.argmax(sums))
    return _cell(s, "move", s.move == best, total, f"in move {best}", value=best)


def _ranges(s: _Signal, total: float) -> list[Where]:
    """Ranges of position, velocity (samples in motion only) and time."""
    moving = s.valid & (s.phase != REST) & (s.phase != SETTLING)
    cells: list[Where] = []
    for by, values, counted, unit, scale, name in (
        ("position", s.position, moving, s.unit("m"), 1e3, s.unit("mm")),
        ("velocity", s.velocity, moving, s.unit("m/s"), 1e3, s.unit("mm/s")),
        ("time", s.time, s.valid, "s", 1.0, "s"),
    ):
        if not counted.any() or np.ptp(values[counted]) == 0.0:
            continue
        edges = np.linspace(values[counted].min(), values[counted].max(), BINS + 1)
        bins = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, BINS - 1)
        energy, samples = (
            np.histogram(bins[counted], np.arange(BINS + 1), weights=weights)[0]
            for weights in (s.energy[counted], np.ones(int(counted.sum())))
        )
        first, last = _densest(energy, samples)
        if last - first + 1 >= BINS - 2:
            continue
        low, high = float(edges[first]), float(edges[last + 1])
        inside = counted & (bins >= first) & (bins <= last)
        words = f"at {by} {low * scale:.3g} to {high * scale:.3g} {name}"
        cells += _cell(s, by, inside, total, words, range=(low, high), unit=unit)
    return cells


def _densest(energy: Weights, samples: Weights) -> tuple[int, int]:
    """First and last bin of the range whose energy most exceeds its share of the samples."""
    if energy.sum() <= 0 or samples.sum() <= 0:
        return 0, len(energy) - 1
    surplus = energy / energy.sum() - samples / samples.sum()
    sums = np.concatenate(([0.0], np.cumsum(surplus)))
    gains = sums[None, 1:] - sums[:-1, None]
    gains[np.tril_indices(len(surplus), -1)] = -np.inf
    first, last = np.unravel_index(int(np.argmax(gains)), gains.shape)
    return int(first), int(last)


def _frequencies(s: _Signal, total: float) -> list[Where]:
    """The band of temporal frequency that holds more than its share."""

    def spectrum(values: FloatArray) -> Weights:
        power = np.zeros(len(_BANDS) - 1)
        for start, end in zip(s.starts, (*s.starts[1:], len(values)), strict=True):
            part = np.where(s.valid[start:end], values[start:end], 0.0)
            lines = np.abs(np.fft.rfft(part)) ** 2 * 2.0 / len(part)
            at = np.fft.rfftfreq(len(part), s.period)
            power += np.histogram(at, _BANDS, weights=lines)[0]
        return power / s.floor**2 if s.floor > 0 else power

    energy = spectrum(s.residual) - np.mean([spectrum(draw) for draw in s.draws], axis=0)
    energy = np.maximum(energy, 0.0)
    first, last = _densest(energy, np.ones(len(energy)))
    if last - first + 1 >= len(energy) - 2 or energy.sum() <= 0:
        return []
    share = float(energy[first : last + 1].sum()) / total
    low, high = float(_BANDS[first]), float(_BANDS[last + 1])
    text = f"{s.axis} {s.signal}: {_percent(share)} of the gap is at {low:.3g} to {high:.3g} Hz"
    return [
        Where(
            s.axis, s.signal, "frequency", min(share, 1.0), range=(low, high), unit="Hz", text=text
        )
    ]


def _pitches(s: _Signal, total: float) -> list[Where]:
    """The spatial frequency of the wave over position that explains most energy."""
    moving = s.valid & (np.abs(s.velocity) > _MOVING)
    travel = float(np.ptp(s.position[moving])) if moving.any() else 0.0
    if moving.sum() < 500 or travel < 0.02:
        return []
    lines = _SPATIAL[_SPATIAL * travel >= 1.5]
    values = np.vstack([s.residual, s.draws])[:, moving]
    values = values - values.mean(axis=1)[:, None]
    taken = _wave_energy(s.travelled[moving], values, lines)
    energy = taken[0] - taken[1:].mean(axis=0)
    best = int(np.argmax(energy))
    share = float(energy[best]) / s.floor**2 / total if s.floor > 0 else 0.0
    half = 0.5 / travel
    low, high = float(lines[best] - half), float(lines[best] + half)
    text = (
        f"{s.axis} {s.signal}: {_percent(share)} of the gap is a wave over position "
        f"with a period of {1e3 / lines[best]:.3g} {s.unit('mm')}"
    )
    unit = s.unit("1/m")
    return [
        Where(
            s.axis, s.signal, "frequency", min(share, 1.0), range=(low, high), unit=unit, text=text
        )
    ]


def _wave_energy(position: FloatArray, values: FloatArray, lines: Weights) -> Weights:
    """Energy that waves over position explain, float64[n, lines].

    Args:
        position: float64[T] [m].
        values: float64[n, T].
        lines: spatial frequencies [1/m].
    """
    twice = wave_sums(2.0 * lines, position, np.ones(len(position)))
    cc, ss = 0.5 * (len(position) + twice.real), 0.5 * (len(position) - twice.real)
    cs = -0.5 * twice.imag
    sums = np.array([wave_sums(lines, position, row) for row in values])
    c, z = sums.real, -sums.imag
    power: Weights = (ss * c**2 - 2 * cs * c * z + cc * z**2) / (cc * ss - cs**2)
    return power


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %"
