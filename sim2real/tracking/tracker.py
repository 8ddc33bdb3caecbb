"""The stage tracked sample by sample: a simulation that the recording keeps on course.

A free-run simulation drifts from the recording for reasons that are not the model's fault: friction
wanders, and elements on the verge of slipping do or don't. Here the same simulation is corrected at
each SYNC by the encoder (an extended Kalman filter on position, velocity, friction force and the
wandering factor on the Coulomb level). What it could not predict one SYNC ahead, the innovation, is
what models are compared by. Under the right model the innovations are white and as large as their
covariance says, and their sum of squares is a likelihood (prediction-error method: Ljung, System
Identification, ch. 7) of the model with all its effects.

The covariance comes from `sim2real.tracking.error_states`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hil_sim.effects.ports import EffectPorts
from hil_sim.plant import Arrays
from hil_sim.settings import SUBSTEPS, AxisSettings, StageSettings
from sim2real.gap import Replay, run_by_model, stated_step
from sim2real.tracking.error_states import (
    STATES,
    Gains,
)
from sim2real.tracking.kernel import Deviations, Filter, Recorded, Tracked, track
from stagedata import BoolArray

F64 = NDArray[np.float64]

_FINE = 1e-13
"""Increment of the simulated encoder between SYNCs [m]: its rounding would only add noise."""
_GAINS = {
    "gain": (STATES,), "deviation": (), "transition": (STATES, STATES), "force": (STATES,),
    "level": (STATES,),
}  # fmt: skip


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


@dataclass(frozen=True, slots=True, eq=False)
class _Run:
    """Results of the kernel for K samples of some axes.

    Attributes:
        out: field of `Tracked` -> float64[K, axes].
        filter: field of `Filter` -> float64[K, axes, ...], where gains were computed.
    """

    out: dict[str, F64]
    filter: dict[str, F64]

    def gains(self, at: int) -> Gains:
        """Gains of one axis."""
        return Gains(**{name: np.ascontiguousarray(v[:, at]) for name, v in self.filter.items()})


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
    """Tracks one axis of a recording under any model of it.

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
        if needs_other_axes(model, self._stage.sync_period):
            axes, columns, at = list(self._others), list(range(len(self._others))), self._index
            axes[at] = model
            if gains is not None:
                known = list(self._of_others)
                known[at] = gains
        run = self._tracked(axes, columns, known, [stage_substeps] * len(axes))
        found = gains or run.gains(at)
        return self._seen(run, at, found), found

    def variants(
        self, models: Sequence[AxisSettings], gains: Gains, stage_substeps: Sequence[float]
    ) -> list[Track | None]:
        """Track the axis under several models at once, each in little more than half the time.

        The processor works on one simulation while another waits for its own results.

        Args:
            models: of the axis, effects included.
            gains: as in `run`.
            stage_substeps: of each model, as in `run`.

        Returns:
            A track for each, None for effects that physics does not allow.
        """
        found: list[Track | None] = [None] * len(models)
        groups: dict[int, list[int]] = {}
        for i, (model, steps) in enumerate(zip(models, stage_substeps, strict=True)):
            try:
                together = needs_other_axes(model, self._stage.sync_period)
            except ValueError:
                continue
            if together:
                found[i] = self._if_possible(model, gains, steps)
            else:
                groups.setdefault(self._steps(steps), []).append(i)
        for group in groups.values():
            axes, columns = [models[i] for i in group], [self._index] * len(group)
            try:
                own = [stage_substeps[i] for i in group]
                run = self._tracked(axes, columns, [gains] * len(group), own)
            except ValueError:  # of one of them: tracked alone, it shows which
                for i in group:
                    found[i] = self._if_possible(models[i], gains, stage_substeps[i])
            else:
                for at, i in enumerate(group):
                    found[i] = self._seen(run, at, gains)
        return found

    def _if_possible(
        self, model: AxisSettings, gains: Gains, stage_substeps: float
    ) -> Track | None:
        try:
            return self.run(model, gains, stage_substeps)[0]
        except ValueError:
            return None

    @cached_property
    def _of_others(self) -> list[Gains]:
        """Gains of all axes with the effects they have beside this one, computed once."""
        count = len(self._others)
        run = self._tracked(self._others, list(range(count)), None, [SUBSTEPS] * count)
        return [run.gains(a) for a in range(count)]

    def _steps(self, stage_substeps: float) -> int:
        """Plant steps per control tick of a simulation that stands for `stage_substeps` ones."""
        return self._substeps if self._substeps < SUBSTEPS else round(stage_substeps)

    def _tracked(
        self,
        axes: Sequence[AxisSettings],
        columns: Sequence[int],
        gains: Sequence[Gains] | None,
        stage_substeps: Sequence[float],
    ) -> _Run:
        """Track several axes of the recording, or several variants of one, column by column."""
        stage = replace(
            self._stage,
            axes=tuple(replace(a, increment=_FINE) for a in axes),
            start=self._replay.start,
        )
        recorded = Recorded(
            np.ascontiguousarray(self._replay.demand[:, columns]),
            np.ascontiguousarray(self._replay.offset[:, columns]),
            np.ascontiguousarray(self._measured[:, columns]),
            np.ascontiguousarray(self._force[:, columns]),
            np.ascontiguousarray(self._valid[:, columns]),
        )
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
        out = {name: np.zeros((count, len(axes))) for name in Tracked._fields}
        known = 0 if gains is None else count
        fresh = {
            name: np.zeros((count - known, len(axes), *shape)) for name, shape in _GAINS.items()
        }
        gain = fresh["gain"] if gains is None else np.stack([g.gain for g in gains], axis=1)
        filter_arrays = Filter(**{**fresh, "gain": gain})
        track(arrays.mechanics, recorded, deviations, gains is None, Tracked(**out), filter_arrays)
        return _Run(out, {**fresh, "gain": gain})

    def _seen(self, run: _Run, at: int, gains: Gains) -> Track:
        """The track of one axis of a run."""
        motor = run.out["motor"][:, at]
        step = self._replay.steps[self.axis.name].get("force")
        return Track(
            position=run.out["innovation"][:, at] / gains.deviation,
            force=(self._force[:, self._index] - motor) / force_deviation(self.axis, step),
            valid=self.valid,
            x=run.out["x"][:, at],
            v=run.out["v"][:, at],
            motor=motor,
            level=run.out["level"][:, at],
        )


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


def needs_other_axes(model: AxisSettings, period: float) -> bool:
    """Whether an effect of this axis depends on what the other axes do."""
    ports = EffectPorts(model, period, period)
    for effect in model.effects:
        effect.apply(ports)
    return bool(ports.coupled_mass or ports.fields)
