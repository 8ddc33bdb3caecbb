"""A peer of the diagnosis: sparse regression in the force domain, as in the identification of robots.

The residual force, less mass times the residual acceleration, is regressed on columns of physical
meaning. Orthogonal matching pursuit selects them: the best column (or pair) is added as long as it
improves the prediction of held-out moves. Whatever acts within the control loop (delays,
bandwidths, resonances) has no column: it changes the motion, not the force that a given motion
takes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

from hil_sim.effects.effect import Effect
from hil_sim.settings import AxisSettings
from sim2real.rivals.coordinates import stop_operators
from sim2real.diagnosis import Examination
from sim2real.fitting import BASE, MAX_SIGMAS, NUISANCES, AxisModel, Term, coordinates
from sim2real.gap import Measured
from sim2real.phases import split_moves

F64 = NDArray[np.float64]

_LOW = 80.0
"""Positions and forces are filtered up to this frequency before they are differentiated [Hz]."""
_MOVING = 0.02
"""Demanded velocity above which friction is fully developed and has its sign [m/s]."""
_PAYS = 0.05
"""Share of the energy left on held-out moves that a further column must remove."""
_MOST = 6
"""Columns or pairs that are selected."""
_PLANT = (("payload_mass", "mass"), ("coulomb_level", "coulomb"), ("viscous_damping", "viscous"))
"""Effects that the three columns present from the start stand for, and the figures they change."""
_PITCHES, _CENTERS, _TIMES = 60, 12, 4
"""Number of pitches, centres and time constants in the grids of columns."""


@dataclass(frozen=True, slots=True, eq=False)
class _Group:
    """Columns that stand for one effect, and the values that their coefficients give it."""

    effect: str
    columns: F64
    values: Callable[[F64], dict[str, float]]


def regress_forces(
    examined: Examination, tolerance: Mapping[str, float], library: Mapping[str, Effect]
) -> dict[str, AxisModel]:
    """Axis -> model with the effects named, in the order of selection.

    Args:
        examined: one recording.
        tolerance: axis -> relative standard deviation of the plant's figures.
        library: effects by name.
    """
    return {
        axis.name: _regress_axis(axis, examined.measured[0], tolerance[axis.name], library)
        for axis in examined.settings.axes
    }


def _regress_axis(
    axis: AxisSettings, measured: Measured, tolerance: float, library: Mapping[str, Effect]
) -> AxisModel:
    recording, friction = measured.replay.recording, axis.friction
    low = butter(3, 2.0 * _LOW * measured.replay.period, output="sos")
    motions = {}
    for name, signals in recording.axes.items():
        position = sosfiltfilt(low, signals.position_actual)
        speed = np.gradient(position, recording.time)
        motions[name] = (position, speed, np.gradient(speed, recording.time))
    position, speed, acceleration = motions[axis.name]
    left = {key: sosfiltfilt(low, values) for key, values in measured.residual[axis.name].items()}
    curved = np.gradient(np.gradient(left["position"], recording.time), recording.time)
    force = left["force"] - axis.mass * curved
    way = np.sign(np.gradient(recording.axes[axis.name].position_demand, recording.time))
    body = axis.mass * acceleration + friction.coulomb * way + friction.viscous * speed
    fast = np.abs(np.gradient(recording.axes[axis.name].position_demand, recording.time))
    own = measured.replay.valid(axis.name) & (fast > _MOVING)
    others = [each[2] for name, each in motions.items() if name != axis.name]
    plain = np.column_stack([acceleration, friction.coulomb * way, speed])
    groups = _groups(axis, recording.time, position, body, way, others)
    groups = [_Group(g.effect, g.columns[own], g.values) for g in groups if g.effect in library]
    fold = np.zeros(len(recording), dtype=np.int64)
    for block in split_moves(recording, measured.replay.period):
        fold[block.start : block.stop] = (block.number // 2) % 2
    chosen, weights = _pursue(plain[own], groups, force[own], fold[own])
    relative = weights[:3] / np.array([axis.mass, 1.0, max(friction.viscous, 1e-12)])
    limit = MAX_SIGMAS * tolerance
    everything = np.hstack([plain[own], *(g.columns for g in chosen)])
    least = _held_out(everything, force[own], fold[own])
    for k in range(3):  # a figure that improves held-out moves too little stays in tolerance
        fewer = np.delete(everything, k, axis=1)
        if _held_out(fewer, force[own], fold[own]) < least / (1.0 - _PAYS):
            relative[k] = np.clip(relative[k], -limit, limit)
    terms, base = [], np.zeros(NUISANCES)
    if min(abs(relative[:2])) > limit and abs(relative[0] - relative[1]) < limit:
        # Mass and friction both seem larger by the same factor if the motor's force is smaller.
        terms.append(_term(library["force_constant"], axis, [1.0 / (1.0 + float(relative[0]))]))
        relative = np.zeros(3)
    for (effect, figure), part in zip(_PLANT, relative, strict=True):
        if abs(part) > limit and effect in library:
            value = part * axis.mass if figure == "mass" else 1.0 + part
            terms.append(_term(library[effect], axis, [float(value)]))
        else:
            base[BASE.index(figure)] = np.clip(part, -limit, limit)
    at = 3
    for group in chosen:
        width = group.columns.shape[1]
        values = group.values(weights[at : at + width])
        at += width
        if group.effect not in {term.name for term in terms}:
            named = library[group.effect]
            terms.append(_term(named, axis, [values[p.key] for p in named.parameters]))
    return AxisModel(base, tuple(terms))


def _term(effect: Effect, axis: AxisSettings, values: Sequence[float]) -> Term:
    entries = coordinates(effect, axis)
    return Term(effect, tuple(e.clipped(v) for e, v in zip(entries, values, strict=True)))


def _groups(
    axis: AxisSettings,
    time: F64,
    position: F64,
    body: F64,
    way: F64,
    others: Sequence[F64],
) -> list[_Group]:
    """Columns beside mass, Coulomb and viscous friction, float64[T, 1 or 2] each (long: a list)."""
    one, coulomb = np.ones_like(time), axis.friction.coulomb
    found = [
        _Group("force_offset", one[:, None], lambda c: {"force": c[0]}),
        _Group(
            "cable_stiffness",
            np.column_stack([position, one]),
            lambda c: {"stiffness": c[0], "center": -c[1] / (c[0] or 1.0)},
        ),
    ]
    found += [_Group("cross_coupling", a[:, None], lambda c: {"mass": c[0]}) for a in others]
    for width in np.geomspace(1.5e-4, 2e-2, 8):
        stop = stop_operators(position, np.array([width]))
        found.append(
            _Group(
                "cable_hysteresis",
                stop,
                lambda c, w=width: {"force": c[0], "stiffness": abs(c[0]) / w},  # type: ignore[misc]
            )
        )
    for center in np.linspace(position.min(), position.max(), _CENTERS):
        for width in (6e-3, 12e-3, 24e-3):
            bell = np.exp(-0.5 * ((position - center) / width) ** 2)
            found.append(
                _Group(
                    "friction_position",
                    (coulomb * way * bell)[:, None],
                    lambda c, x=center, w=width: {"amplitude": c[0], "center": x, "width": w},  # type: ignore[misc]
                )
            )
    for constant in np.geomspace(3.0, 60.0, _TIMES):
        decay = coulomb * way * np.exp(-time / constant)
        found.append(
            _Group(
                "thermal_drift",
                decay[:, None],
                lambda c, t=constant: {"amplitude": c[0], "time_constant": t},  # type: ignore[misc]
            )
        )
    for pitch in np.geomspace(0.006, 0.05, _PITCHES):
        angle = 2.0 * math.pi * position / pitch
        wave = np.column_stack([np.sin(angle), np.cos(angle)])
        found.append(_Group("cogging", wave, _waved("amplitude", "pitch", pitch, 1.0)))
        ripple = body[:, None] * wave
        found.append(_Group("force_ripple", ripple, _waved("ratio", "pitch", pitch, -1.0)))
    duration = float(time[-1] - time[0])
    for frequency in np.arange(8.0, 100.0, 0.5 / duration):
        angle = 2.0 * math.pi * frequency * time
        wave = np.column_stack([np.sin(angle), np.cos(angle)])
        found.append(
            _Group("floor_vibration", wave, _waved("amplitude", "frequency", frequency, 1.0))
        )
    return found


def _waved(size: str, key: str, value: float, sign: float) -> Callable[[F64], dict[str, float]]:
    """Values of a wave from the coefficients of its sine and cosine."""

    def values(c: F64) -> dict[str, float]:
        along, across = sign * float(c[0]), sign * float(c[1])
        return {size: math.hypot(along, across), key: value, "phase": math.atan2(across, along)}

    return values


def _pursue(
    plain: F64, groups: Sequence[_Group], target: F64, fold: NDArray[np.int64]
) -> tuple[list[_Group], F64]:
    """Groups selected, and the coefficients of the plain columns and of theirs."""
    chosen: list[_Group] = []
    columns = plain
    left = _held_out(columns, target, fold)
    while len(chosen) < _MOST:
        basis = np.linalg.qr(columns)[0]
        rest = target - basis @ (basis.T @ target)
        best = max(groups, key=lambda g: _explained(g.columns, basis, rest))
        wider = np.hstack([columns, best.columns])
        now = _held_out(wider, target, fold)
        if now > (1.0 - _PAYS) * left:
            break
        chosen.append(best)
        columns, left = wider, now
    return chosen, np.asarray(np.linalg.lstsq(columns, target, rcond=None)[0], dtype=np.float64)


def _explained(columns: F64, basis: F64, rest: F64) -> float:
    """Energy of a residual that columns explain beside a basis; a second column has to pay, too."""
    free = columns - basis @ (basis.T @ columns)
    gram, load = free.T @ free, free.T @ rest
    if np.trace(gram) < 1e-9 * np.square(columns).sum():
        return 0.0
    second = float(_PAYS * (columns.shape[1] - 1) * (rest @ rest))
    explained = float(load @ np.linalg.lstsq(gram, load, rcond=1e-9)[0])
    return explained - second


def _held_out(columns: F64, target: F64, fold: NDArray[np.int64]) -> float:
    """Energy left on each half of the moves by a fit to the other half [N^2]."""
    energy = 0.0
    for part in (0, 1):
        own = fold == part
        found = np.linalg.lstsq(columns[~own], target[~own], rcond=None)[0]
        energy += float(np.square(target[own] - columns[own] @ found).sum())
    return energy
