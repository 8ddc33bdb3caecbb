"""Identifies the friction figures of an axis from recordings, by `estimation.offline`.

Nothing here is used while a stage moves.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimation.friction import F64, FrictionState, count_states
from estimation.known_effects import known_figures
from estimation.move import MoveData
from estimation.noise import encoder_noise, quantisation
from estimation.offline import Identification, OfflineSettings, Samples, identify
from estimation.sampled_force import kink_share, modelled_friction, with_mean_force
from stagectl.config.machine import Axis, Machine
from stagectl.config.settings.host_model import kink_delay
from stagectl.config.settings.known_effects import axis_as_known, known_terms
from stagectl.errors import UnusableInput
from stagectl.sequencer.compensation.known_axis import KnownAxis
from stagedata import FrictionFigures, Recording

REPEAT_FROM = 0.05
"""Relative change of a figure from which the mean force around a SYNC is computed again."""

_FIGURES = (
    "coulomb viscous stiffness relaxation_rate static_ratio stribeck_velocity stribeck_shape"
).split()


def settings_of(axis: Axis, period: float) -> OfflineSettings:
    """Sensors and mass of an axis by its machine file; `period` is Ts [s]."""
    wander = axis.plant.friction.repeatability
    return OfflineSettings(
        mass=axis.plant.mass,
        period=period,
        position_noise=encoder_noise(axis.encoder.noise, axis.encoder.increment),
        force_noise=quantisation(axis.drive.force_unit),
        peak_force=axis.drive.peak_force,
        wander=wander.coulomb,
        correlation_time=wander.correlation_time,
    )


def identify_axis(
    recordings: Sequence[Recording], machine: Machine, name: str, elements: int | None = None
) -> Identification:
    """Estimate all friction figures of one axis from recordings.

    Forces of the machine file's effects, as far as a host compensates them, are subtracted first.

    Args:
        recordings: of one stage, in any order.
        machine: prior figures, and effects.
        name: of the axis.
        elements: number of Maxwell-slip elements; default: the machine file's.

    Raises:
        UnusableInput: a recording lacks that axis or samples, or has another SYNC period; or the
            machine file has another friction law than gms.
    """
    axis, period = machine.axes[name], machine.bus.sync_period
    friction = axis.plant.friction.figures
    if not friction.has("stiffness"):
        key = f"axes.{name}.plant.friction.model"
        raise UnusableInput(
            f"{machine.source}: {key}: identification starts from figures of gms, is {friction.law}"
        )
    if elements is not None:
        friction = replace(friction, elements=elements)
    terms = known_terms(machine).get(name)
    if terms is not None:
        axis, friction = axis_as_known(axis, terms), known_figures(terms, friction)
    number = list(machine.axes).index(name)
    pieces: list[tuple[Samples, F64]] = []
    offset = 0.0
    for recording in recordings:
        where = f"{recording.source}: axis {name}"
        if name not in recording.axes:
            raise UnusableInput(f"{where}: the recording has no such axis")
        try:
            new = _pieces(recording, name, period, offset)
        except ValueError as error:
            raise UnusableInput(f"{where}: {error}") from error
        if terms is not None:
            known = KnownAxis(terms, number, axis, period)
            new = [
                _without_known(piece, known, _paths(recording, machine, piece[0].time - offset))
                for piece in new
            ]
        pieces += new
        offset = new[-1][0].time + 2.0 * period * len(new[-1][1])  # never continuous
    return identify_pieces(pieces, axis, friction, period)


def identify_pieces(
    pieces: Sequence[tuple[Samples, F64]], axis: Axis, friction: FrictionFigures, period: float
) -> Identification:
    """As `identify_axis`, from samples and the force offsets sent for them [N].

    Runs twice where the figures differ much from the prior ones, for the mean force around a SYNC
    depends slightly on them.
    """
    settings = settings_of(axis, period)
    level = [around_syncs(piece, sent, axis, friction, period) for piece, sent in pieces]
    answer = identify(level, friction, settings)
    if answer.reason is not None or not _differs(friction, answer):
        return answer
    figures: dict[str, Any] = {name: answer[name].value for name in _FIGURES}
    found = replace(friction, **figures)  # its hysteresis keeps its shape
    level = [around_syncs(piece, sent, axis, found, period) for piece, sent in pieces]
    again = identify(level, friction, settings)
    return answer if again.reason is not None else again


def _differs(friction: FrictionFigures, answer: Identification) -> bool:
    """Whether the figures behind the element forces differ much from the prior ones."""
    return any(
        abs(answer[name].value / float(getattr(friction, name)) - 1.0) > REPEAT_FROM
        for name in ("coulomb", "stiffness")
    )


def around_syncs(
    piece: Samples, sent: F64, axis: Axis, friction: FrictionFigures, period: float
) -> Samples:
    """Samples with the mean force around each SYNC; see `estimation.sampled_force`.

    Args:
        piece: as sampled.
        sent: force offset sent for each sample [N], shape (K,); in effect one SYNC later.
        axis: of the machine file.
        friction: prior model.
        period: Ts [s].
    """
    move = MoveData(piece.position, piece.force, piece.valid, piece.time, 0.0)
    state = FrictionState.relaxed(count_states(friction), float(piece.position[0]))
    share = kink_share(period, kink_delay(axis.drive))
    commanded = np.nan_to_num(np.concatenate([sent[:1], sent[:-1]]))
    modelled = modelled_friction(move, friction, state, period)
    level = with_mean_force(move, share, modelled, axis.drive.peak_force, commanded)
    return replace(piece, force=level.force)


def _without_known(
    piece: tuple[Samples, F64], known: KnownAxis, paths: tuple[F64, NDArray[np.bool_]]
) -> tuple[Samples, F64]:
    """A piece without known forces, and carries their state through it.

    Args:
        piece: samples, and the force offsets sent for them [N].
        known: forces of the axis.
        paths: positions of all axes from the piece's first sample on [m], and where all are valid.
    """
    samples, sent = piece
    count = len(sent)
    path, seen = paths[0][:count], paths[1][:count]
    move = MoveData(samples.position, samples.force, samples.valid, samples.time, 0.0)
    rest = known.without(move, path, seen)
    known.carry(path)
    valid = samples.valid if rest.disturbed is None else samples.valid & ~rest.disturbed
    return replace(samples, force=rest.force, valid=valid), sent + rest.force - samples.force


def _paths(recording: Recording, machine: Machine, begin: float) -> tuple[F64, NDArray[np.bool_]]:
    """Positions of the machine's axes from a time on [m], (K, n), and where all of them are valid.

    An axis without samples counts as at rest at 0; invalid ones are interpolated.
    """
    first = int(np.searchsorted(recording.time, begin - 1e-9))
    index = np.arange(first, len(recording))
    path = np.zeros((len(index), len(machine.axes)))
    seen = np.ones(len(index), dtype=np.bool_)
    for column, name in enumerate(machine.axes):
        signals = recording.axes.get(name)
        if signals is not None and (valid := signals.valid[first:]).any():
            path[:, column] = np.interp(index, index[valid], signals.position_actual[first:][valid])
            seen &= valid
    return path, seen


def _pieces(
    recording: Recording, name: str, period: float, offset: float
) -> list[tuple[Samples, F64]]:
    """Samples and force offsets of one axis, split where the host skipped SYNC periods.

    Raises:
        ValueError: SYNCs that are not a period apart, or too few samples.
    """
    steps = np.diff(recording.time) / period
    if len(steps) and abs(float(np.median(steps)) - 1.0) > 0.01:
        found = float(np.median(steps)) * period
        raise ValueError(f"SYNC period is {found:.6g} s, the machine file's {period:g} s")
    signals = recording.axes[name]
    edges = [0, *(np.flatnonzero(steps > 1.5) + 1).tolist(), len(recording)]
    pieces = []
    for begin, end in itertools.pairwise(edges):
        if end - begin < 3 or signals.valid[begin:end].sum() < 3:
            continue
        part = slice(begin, end)
        samples = Samples(
            signals.position_actual[part],
            signals.force_actual[part],
            signals.valid[part],
            offset + float(recording.time[begin]),
            signals.position_demand[part],
        )
        pieces.append((samples, signals.force_offset[part]))
    if not pieces:
        raise ValueError("fewer than three valid samples in a row")
    return pieces
