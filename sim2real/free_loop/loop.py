"""One axis run free under models: what each leaves of the recording, over the floor.

No filter corrects the run, so what is left is what users see: the gap. A residual, float64[R], is
recorded minus simulated over the floor: positions of the valid samples of a recording, then their
forces, then the next recording.

Source: docs/decisions/0014-free-loop.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from hil_sim.plant import needs_all_axes, simulate, simulate_variants
from hil_sim.settings import SUBSTEPS, AxisSettings, StageSettings
from sim2real.fitting import BASE, NUISANCES, STEP, AxisModel, Workers
from sim2real.free_loop.known_force import known_force
from sim2real.gap import Measured
from sim2real.held_out import FOLDS
from sim2real.phases import split_moves
from sim2real.waves import wave_sums
from stagedata import F64, BoolArray

_SIDE_BY_SIDE = 4
"""Models simulated at once: more gain nothing."""
_SHORTEST = 8e-4
"""Shortest pitch that is sought [m]."""
_OVERSAMPLED = 4
"""Lines per wave over the whole travel or time."""
_MOVING = 0.05
"""Share of the highest speed from which an axis counts as moving."""
_LOW = 120.0
"""Frequency up to which the residual force is known: above, the encoder's noise hides it [Hz]."""


class FreeLoop:
    """One axis of one or several recordings, run free.

    Args:
        name: of the axis.
        measured: the recordings, with their floors.
        settings: of the machine file.
        tolerance: relative standard deviation of the base parameters.
        workers: threads that the simulations are shared among.
        known: a force besides the models' in each recording, float64[K] each [N]; may be none.

    Attributes:
        axis: of the machine file.
        spread: standard deviations of the nuisance parameters, float64[NUISANCES].
        has_figure: whether the machine file's figure is not zero, of each base parameter.
        move: number of the move that each element belongs to, int64[R].
        samples: valid samples of each move, float64[moves].
        pair: number of the pair, there and back, that each move belongs to, int64[moves].
        fold: number of its fold, int64[moves].
        duration: of the longest recording [s].
        travelled: lowest and highest demand [m].
        extent: the distance between them [m].
        coherent: elements that count as one: the samples of the time over which friction wanders.
        diverged: floors to which elements are clipped, where a model makes the stage run away.
    """

    diverged = 1e3

    def __init__(
        self,
        name: str,
        measured: Sequence[Measured],
        settings: StageSettings,
        tolerance: float,
        workers: Workers | None = None,
        known: Sequence[F64] = (),
    ) -> None:
        self.name = name
        self._known = [known_force(force) for force in known]
        self.settings = settings
        self.workers = workers or Workers()
        self._at = [a.name for a in settings.axes].index(name)
        self.axis: AxisSettings = settings.axes[self._at]
        self.spread: F64 = np.full(STEP, tolerance, dtype=np.float64)
        coarse = all(a.friction.law == "gms" for a in settings.axes)
        self._substeps = 1 if coarse else SUBSTEPS
        self.start = AxisModel(np.zeros(NUISANCES))
        self.has_figure = [
            name == "mass" or getattr(self.axis.friction, name) != 0.0 for name in BASE
        ]
        self.measured = tuple(measured)
        moves, pairs, count = [], [], 0
        for m in measured:
            valid = m.replay.valid(name)
            number = np.zeros(len(valid), dtype=np.int64)
            blocks = split_moves(m.replay.recording, m.replay.period)
            for block in blocks:
                number[block.start : block.stop] = count + block.number
            count += len(blocks)
            pairs += [block.number // 2 for block in blocks]
            moves += [number[valid]] * 2
        self.move: NDArray[np.int64] = np.concatenate(moves)
        self.samples: F64 = np.bincount(self.move, minlength=count) / 2.0
        self.pair = np.array(pairs, dtype=np.int64)
        self.fold = self.pair % FOLDS
        period = measured[0].replay.period
        demands = [m.replay.demand[:, self._at] for m in measured]
        self.duration = max(map(len, demands)) * period
        self.travelled = min(float(d.min()) for d in demands), max(float(d.max()) for d in demands)
        self.extent = max(self.travelled[1] - self.travelled[0], 1e-6)
        self.coherent = max(1.0, self.axis.correlation_time / period)

    def _floors(self, m: Measured) -> tuple[float, float]:
        """Of position and force [m, N]."""
        floor = m.floor.rms[self.name]
        return max(floor["position"], 1e-12), max(floor["force"], 1e-12)

    def residuals(self, models: Sequence[AxisModel]) -> list[F64 | None]:
        """What models leave, float64[R] each; None for values that physics does not allow."""
        return self.workers.spread(self._side_by_side, models, _SIDE_BY_SIDE)

    def allows(self, model: AxisModel) -> bool:
        """Whether a model can be simulated: effects may be possible alone and not together."""
        return self.residuals([model])[0] is not None

    def residual(self, model: AxisModel) -> F64:
        """What a model leaves, float64[R].

        Raises:
            ValueError: values that physics does not allow.
        """
        (found,) = self.residuals([model])
        if found is None:
            raise ValueError(f"axis {self.name}: these values are not physical")
        return found

    def _side_by_side(self, models: Sequence[AxisModel]) -> list[F64]:
        self.workers.check()
        axes = [model.settings(self.axis) for model in models]
        coupled = [
            needs_all_axes(StageSettings(self.settings.sync_period, (axis,))) for axis in axes
        ]
        alone = [axis for axis, joint in zip(axes, coupled, strict=True) if not joint]
        numbers = range(len(self.measured))
        each = zip(*(self._simulated(number, alone) for number in numbers), strict=True)
        return [
            np.concatenate(
                [self._left(n, *self.respond_jointly(n, axis)) for n in numbers]
                if joint
                else next(each)
            )
            for axis, joint in zip(axes, coupled, strict=True)
        ]

    def respond(self, number: int, variants: Sequence[AxisSettings]) -> tuple[F64, F64]:
        """Positions and forces of variants of the axis, float64[P, variants] each [m, N].

        Args:
            number: of the recording, from 0.
            variants: settings of the axis; no effect involves another one.

        Raises:
            ValueError: values that physics does not allow.
        """
        replay, at = self.measured[number].replay, self._at
        each = tuple(self._beside_known(number, variant) for variant in variants)
        stage = StageSettings(self.settings.sync_period, each, replay.start)
        response = simulate_variants(
            stage, replay.demand[:, at], replay.offset[:, at], replay.rest_force[at],
            rounded=False, substeps=self._substeps,
        )  # fmt: skip
        return response.position, response.force

    def respond_jointly(self, number: int, axis: AxisSettings) -> tuple[F64, F64]:
        """Position and force of the axis where others must be simulated too, float64[P] [m, N]."""
        replay = self.measured[number].replay
        axis = self._beside_known(number, axis)
        axes = tuple(axis if a.name == self.name else a for a in self.settings.axes)
        stage = replace(self.settings, axes=axes, start=replay.start)
        response = simulate(
            stage, replay.demand, replay.offset, None, replay.rest_force,
            substeps=self._substeps, rounded=False,
        )  # fmt: skip
        return response.position[:, self._at], response.force[:, self._at]

    def _beside_known(self, number: int, axis: AxisSettings) -> AxisSettings:
        """An axis with the force that is known in a recording."""
        return replace(axis, effects=(*axis.effects, *self._known[number : number + 1]))

    def _simulated(self, number: int, variants: list[AxisSettings]) -> list[F64]:
        if not variants:
            return []
        position, force = self.respond(number, variants)
        return [self._left(number, position[:, i], force[:, i]) for i in range(len(variants))]

    def _left(self, number: int, position: F64, force: F64) -> F64:
        m = self.measured[number]
        place, valid = m.replay.place, m.replay.valid(self.name)
        recorded, floors = m.replay.recording.axes[self.name], self._floors(m)
        parts = (
            (recorded.position_actual - position[place])[valid] / floors[0],
            (recorded.force_actual - force[place])[valid] / floors[1],
        )
        residual = np.nan_to_num(np.concatenate(parts), nan=self.diverged)
        return np.asarray(np.clip(residual, -self.diverged, self.diverged))

    def energies(self, residual: F64) -> F64:
        """Squared residual over floor, summed over each move, float64[moves]."""
        summed = np.bincount(self.move, weights=residual**2, minlength=len(self.samples))
        return np.asarray(summed, dtype=np.float64)

    def held_out(self, residuals: Sequence[F64]) -> F64:
        """Energies of the moves, each by the residual of its fold, float64[moves].

        Args:
            residuals: for each of any number of folds, what the model leaves that was fitted to all
                others.
        """
        each = np.array([self.energies(residual) for residual in residuals])
        return np.asarray(each[self.pair % len(each), np.arange(len(self.pair))])

    def gap(self, residual: F64, moves: BoolArray | None = None) -> float:
        """Squared gap over floor, summed over both signals: 2 where nothing but noise is left.

        Args:
            residual: what a model leaves, float64[R].
            moves: those that count, bool[moves]; None for all.
        """
        energies = self.energies(residual)
        if moves is None:
            moves = np.ones(len(energies), dtype=np.bool_)
        return float(energies[moves].sum() / max(self.samples[moves].sum(), 1.0))

    def wave_lines(self, over_travel: bool) -> F64:
        """Waves that are sought in the residual force: per metre of travel, or in Hz."""
        period = self.measured[0].replay.period
        extent = self.extent if over_travel else self.duration
        most = 1.0 / _SHORTEST if over_travel else 0.4 / period
        return np.asarray(np.arange(1.0, max(most * extent, 2.0), 1.0 / _OVERSAMPLED) / extent)

    def wave_power(
        self, residual: F64, model: AxisModel, over_travel: bool, own: BoolArray, per_force: bool
    ) -> F64:
        """Power of the residual force at `wave_lines`, less what friction and a spring explain.

        Args:
            residual: what the model leaves, float64[R].
            model: the model.
            over_travel: over position, where the axis moves; else over time.
            own: elements that count, bool[R].
            per_force: of a wave that multiplies the motor force.
        """
        from scipy.signal import butter, sosfiltfilt  # slow to import

        lines = self.wave_lines(over_travel)
        mass = float(model.settings(self.axis).mass)
        power = np.zeros(len(lines))
        at = 0
        for m in self.measured:
            valid, recorded = m.replay.valid(self.name), m.replay.recording.axes[self.name]
            count, floors = int(valid.sum()), self._floors(m)
            position = residual[at : at + count] * floors[0]
            force = residual[at + count : at + 2 * count] * floors[1]
            counted = own[at : at + count]
            at += 2 * count
            period = m.replay.period
            place = m.replay.place[valid]
            travel = recorded.position_actual[valid]  # it lags behind the demand, each way
            low = butter(3, min(_LOW * 2.0 * period, 0.8), output="sos")
            position, force = sosfiltfilt(low, position), sosfiltfilt(low, force)
            force = force - mass * np.gradient(np.gradient(position, period), period)
            speed = np.gradient(m.replay.demand[place, self._at], period)
            force = force - _plain_part(force, speed, travel)
            if per_force:
                force = force * sosfiltfilt(low, recorded.force_actual[valid])
            if over_travel:
                counted = counted & (np.abs(speed) > _MOVING * np.abs(speed).max())
            where = np.asarray(travel if over_travel else period * place, dtype=np.float64)[counted]
            power += np.abs(wave_sums(lines, where, force[counted])) ** 2
        return power


def _plain_part(force: F64, speed: F64, travel: F64) -> F64:
    """What friction, a constant force and a spring explain of a residual force, float64[T] [N].

    Args:
        force: float64[T] [N].
        speed: of the demand, float64[T] [m/s].
        travel: float64[T] [m].
    """
    columns = np.column_stack([np.ones_like(speed), np.sign(speed), speed, np.abs(speed), travel])
    return np.asarray(columns @ np.linalg.lstsq(columns, force, rcond=None)[0])
