"""The stage tracked sample by sample: a simulation that the recording keeps on course.

A free-run simulation drifts from the recording for reasons that are not the model's fault: friction
wanders, and elements on the verge of slipping do or don't. Here the same simulation is corrected at
each SYNC by the encoder (an extended Kalman filter on position, velocity, friction force and the
wandering factor on the Coulomb level). What it could not predict one SYNC ahead, the innovation, is
what models are compared by. Under the right model the innovations are white and as large as their
covariance says, and their sum of squares is a likelihood (prediction-error method: Ljung, System
Identification, ch. 7) of the model with all its effects.

The covariance comes from `sim2real.tracking.error_states`.

Source: docs/decisions/0012-tracked-innovations.md.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil_sim.plant import Arrays, needs_all_axes
from hil_sim.settings import SUBSTEPS, AxisSettings, StageSettings
from sim2real.gap import Replay, run_by_model, stated_step
from sim2real.tracking.error_states import STATES, Gains
from sim2real.tracking.kernel import Deviations, Recorded, Tracked, track
from stagedata import F64, BoolArray

_FINE = 1e-13
"""Increment of the simulated encoder between SYNCs [m]: its rounding would only add noise."""
_SHAPES = ((STATES,), (), (STATES, STATES), (STATES,), (STATES,))
"""Of the arrays of `Gains` at one SYNC, in their order."""


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """One tracked run of one axis over K samples.

    Attributes:
        position: float64[K], innovations of the position over their standard deviation.
        force: float64[K], recorded minus simulated force actual over its standard deviation.
        valid: bool[K], samples that were recorded.
        x, v: float64[K], tracked position [m] and velocity [m/s] at each SYNC.
        motor: float64[K], simulated force actual [N].
        level: float64[K], factor on the Coulomb level that the filter estimated.
    """

    position: F64
    force: F64
    valid: BoolArray
    x: F64
    v: F64
    motor: F64
    level: F64


def require_presliding(settings: StageSettings) -> None:
    """Refuse a stage whose friction law the filter's error states do not describe.

    Without presliding the force at rest is no function of the state: it cannot be corrected.

    Raises:
        ValueError: naming axis and law.
    """
    for axis in settings.axes:
        if not axis.friction.has("stiffness"):
            raise ValueError(
                f"axis {axis.name}: plant.friction.model: a diagnosis needs gms, "
                f"is {axis.friction.law}"
            )


class Tracker:
    """Tracks one axis of a recording under any model of it, in SI units.

    Args:
        replay: of the recording.
        settings: nominal, of all its axes.
        axis: name of the axis.
        substeps: plant steps per control tick: 1 is quick, 5 the reference; None takes as few as
            are accurate enough.
    """

    def __init__(
        self, replay: Replay, settings: StageSettings, axis: str, substeps: int | None = None
    ) -> None:
        self._substeps = settings.quick_substeps if substeps is None else substeps
        self._stage = settings
        self._index = replay.names.index(axis)
        self._replay = replay
        self._others: tuple[AxisSettings, ...] = tuple(
            replace(axis, effects=()) for axis in settings.axes
        )
        self.axis = settings.axes[self._index]
        shape = replay.demand.shape
        self._measured = np.zeros(shape)
        self._force = np.zeros(shape)
        self._valid = np.zeros(shape, dtype=np.bool_)
        for a, name in enumerate(replay.names):
            signals = replay.recording.axes[name]
            self._measured[replay.place, a] = signals.position_actual
            self._force[replay.place, a] = signals.force_actual
            self._valid[replay.place, a] = signals.valid
        self.time: F64 = np.arange(shape[0], dtype=np.float64) * settings.sync_period
        self.start = replay.start
        self.valid = self._valid[:, self._index]

    def finer(self) -> Tracker:
        """The same tracker with as many plant steps as the reference."""
        other = Tracker(self._replay, self._stage, self.axis.name, SUBSTEPS)
        return other.with_other_axes(self._others)

    def with_other_axes(self, others: Sequence[AxisSettings]) -> Tracker:
        """The same tracker beside these axes, for effects that depend on them.

        Args:
            others: settings of all axes; the tracker's own entry is ignored.
        """
        other = Tracker(self._replay, self._stage, self.axis.name, self._substeps)
        other._others = tuple(others)
        return other

    def of_own_run(self, seed: int) -> Tracker:
        """A tracker of the recording that the nominal model itself would have made."""
        own = run_by_model(self._replay, self._stage, seed)
        return Tracker(own, self._stage, self.axis.name, self._substeps)

    def run(
        self, model: AxisSettings, gains: Gains | None = None, stage_substeps: float = SUBSTEPS
    ) -> tuple[Track, Gains]:
        """Track the axis under a model of it.

        Args:
            model: of the axis, effects included.
            gains: of an earlier run under a similar model; None computes them.
            stage_substeps: plant steps per control tick that the stage is assumed to take.

        Raises:
            ValueError: effects that physics does not allow.
        """
        axes, columns, at = [model], [self._index], 0
        known = None if gains is None else [gains]
        if self._needs_others(model):
            axes, columns, at = list(self._others), list(range(len(self._others))), self._index
            axes[at] = model
            if gains is not None:
                known = list(self._of_others)
                known[at] = gains
        out, arrays = self._tracked(axes, columns, known, [stage_substeps] * len(axes))
        found = gains or _of_axis(arrays, at)
        return self._seen(out, at, found), found

    def variants(
        self, models: Sequence[AxisSettings], gains: Gains, stage_substeps: Sequence[float]
    ) -> list[Track]:
        """Track the axis under several models at once, each in little more than half the time.

        The processor works on one simulation while another waits for its own results.

        Args:
            models: of the axis, effects included.
            gains: as in `run`.
            stage_substeps: of each model, as in `run`.

        Raises:
            ValueError: effects that physics does not allow.
        """
        found: dict[int, Track] = {}
        groups: dict[int, list[int]] = {}
        for i, (model, steps) in enumerate(zip(models, stage_substeps, strict=True)):
            if self._needs_others(model):
                found[i], _ = self.run(model, gains, steps)
            else:
                groups.setdefault(self._steps(steps), []).append(i)
        for group in groups.values():
            axes, columns = [models[i] for i in group], [self._index] * len(group)
            own = [stage_substeps[i] for i in group]
            out, _ = self._tracked(axes, columns, [gains] * len(group), own)
            found |= {i: self._seen(out, at, gains) for at, i in enumerate(group)}
        return [found[i] for i in range(len(models))]

    def _needs_others(self, model: AxisSettings) -> bool:
        return needs_all_axes(StageSettings(self._stage.sync_period, (model,)))

    @cached_property
    def _of_others(self) -> list[Gains]:
        """Gains of all axes with the effects they have beside this one, computed once."""
        count = len(self._others)
        _, arrays = self._tracked(self._others, list(range(count)), None, [SUBSTEPS] * count)
        return [_of_axis(arrays, a) for a in range(count)]

    def _steps(self, stage_substeps: float) -> int:
        """Plant steps per control tick of a simulation that stands for `stage_substeps` ones."""
        return self._substeps if self._substeps < SUBSTEPS else round(stage_substeps)

    def _tracked(
        self,
        axes: Sequence[AxisSettings],
        columns: Sequence[int],
        gains: Sequence[Gains] | None,
        stage_substeps: Sequence[float],
    ) -> tuple[Tracked, Gains]:
        """Track several axes of the recording, or several variants of one, column by column.

        Axes are the second dimension of all arrays, also of the gains where they were computed.
        """
        stage = replace(
            self._stage,
            axes=tuple(replace(a, increment=_FINE) for a in axes),
            start=self._replay.start,
        )
        replay = self._replay

        def of_axes(values: NDArray[Any]) -> NDArray[Any]:
            return np.ascontiguousarray(values[:, columns])

        recorded = Recorded(
            of_axes(replay.demand), of_axes(replay.offset), of_axes(self._measured),
            of_axes(self._force), of_axes(self._valid),
        )  # fmt: skip
        count, period = len(recorded.demand), stage.sync_period
        steps = self._steps(stage_substeps[0])
        start = np.where(recorded.valid[0], recorded.position[0], recorded.demand[0])
        arrays = Arrays(stage, start.tolist(), count * period, steps, fine=stage_substeps)
        for name in ("offset", "from_force", "to_force"):
            arrays.loop[name] = recorded.offset[0]
        arrays.loop["powered"] = True
        for a, axis in enumerate(axes):
            if held := self._replay.rest_force[columns[a]]:
                arrays.balance(a, held, axis)
        _begin(arrays, recorded, period)
        logged = self._replay.steps
        noise = [
            math.hypot(o.noise, logged[o.name].get("position", o.increment) / math.sqrt(12.0))
            for o in self._stage.axes
        ]
        deviations = Deviations(
            np.array([a.wander for a in axes]),
            np.exp(-period / np.array([a.correlation_time for a in axes])),
            np.array(noise)[list(columns)],
            np.array([force_deviation(a, logged[a.name].get("force")) for a in axes]),
        )
        out = Tracked(*(np.zeros((count, len(axes))) for _ in Tracked._fields))
        fresh = 0 if gains is not None else count
        own = Gains(*(np.zeros((fresh, len(axes), *shape)) for shape in _SHAPES))
        if gains is not None:
            own = own._replace(gain=np.stack([g.gain for g in gains], axis=1))
        track(arrays.mechanics, recorded, deviations, gains is None, out, own)
        return out, own

    def _seen(self, out: Tracked, at: int, gains: Gains) -> Track:
        """The track of one axis of a run."""
        motor = out.motor[:, at]
        step = self._replay.steps[self.axis.name].get("force")
        return Track(
            position=out.innovation[:, at] / gains.deviation,
            force=(self._force[:, self._index] - motor) / force_deviation(self.axis, step),
            valid=self.valid,
            x=out.x[:, at],
            v=out.v[:, at],
            motor=motor,
            level=out.level[:, at],
        )


def _of_axis(gains: Gains, at: int) -> Gains:
    """Gains of one axis of several."""
    return Gains(*(np.ascontiguousarray(values[:, at]) for values in gains))


def _begin(arrays: Arrays, recorded: Recorded, period: float) -> None:
    """Begin where the recording does: with its error and, by the next sample, its velocity."""
    for name in ("demand", "from_position", "to_position", "last_demand"):
        arrays.loop[name] = recorded.demand[0]
    known = recorded.valid[:2].all(axis=0)
    moved = np.where(known, recorded.position[1] - recorded.position[0], 0.0)
    demanded = np.where(known, recorded.demand[1] - recorded.demand[0], 0.0)
    arrays.state["velocity"] = moved / period
    arrays.loop["derivative"] = (demanded - moved) / period
    first = recorded.demand[0] - recorded.position[0]
    arrays.loop["last_error"] = np.where(recorded.valid[0], first, 0.0)


def force_deviation(axis: AxisSettings, step: float | None = None) -> float:
    """Standard deviation of the force actual value [N]: rounding, and encoder noise by the loop.

    Args:
        axis: its settings.
        step: of the log [N]; None for the drive's.
    """
    control = axis.control
    unit = stated_step(axis, "force") if step is None else step
    gain = control.kp + control.kd / (control.derivative_time + control.period)
    return math.hypot(unit / math.sqrt(12.0), gain * axis.noise)
