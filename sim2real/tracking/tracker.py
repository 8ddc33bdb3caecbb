"""The stage tracked sample by sample: a simulation that the recording keeps on course.

A free closed-loop simulation drifts from the recording for reasons that are no fault of the model:
friction wanders, elements that were just about to slip do or don't. Here the same simulation is
corrected at each SYNC by what the encoder said (an extended Kalman filter on position, velocity,
friction force and the wandering factor on the Coulomb level), and what it could not predict one
SYNC ahead, the innovation, is what is compared. Under the right model the innovations are white
and as large as their covariance says; their sum of squares is a likelihood (prediction-error
method, Ljung, System Identification, ch. 7), of the model with all its effects.

What the filter is unsure of: `sim2real.error_states`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numba
import numpy as np
from numpy.typing import NDArray

from hil_sim.effects.ports import EffectPorts
from hil_sim.plant.arrays import Arrays
from hil_sim.plant.mechanics import advance, command
from hil_sim.settings import SUBSTEPS, AxisSettings, StageSettings
from sim2real.gap import Replay
from sim2real.recording import BoolArray
from sim2real.tracking.error_states import STATES, Gains, catch, exponential, propagate, rates

F64 = NDArray[np.float64]

_TRUST = 0.03
"""The model's friction is trusted to this share of each of its changes, 1 sigma: what is not known
about elements that slip at a rest or at an onset is noise, not a finding."""
_DRIFT = 1.7e-4
"""Random walk of the friction force per square root of a millisecond, in Coulomb forces."""
_INTEGRAL, _LOUD = 4e-3, 3.0
"""Share of the force actual's deviation that the controller's integral follows per SYNC, and the
standard deviations to which it is cut: the integral wanders by 2 mN in a second, the force is
rounded to 18 mN of deviation."""
_FINE = 1e-13
"""Increment of the simulated encoder between SYNCs [m]: its rounding would only add noise."""
_OUTPUTS = ("innovation", "motor", "x", "v", "level")
_GAINS = {
    "gain": (STATES,), "deviation": (), "transition": (STATES, STATES), "force": (STATES,),
    "level": (STATES,),
}  # fmt: skip
_DERIVATIVE_SHARE = 0.4
"""Share of the derivative gain that a velocity error sees within one SYNC period, for the
covariance only."""


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """One tracked run of one axis.

    Attributes:
        position: float64[K], innovations of the position over their standard deviation.
        force: float64[K], recorded minus simulated force actual over its standard deviation.
        valid: bool[K], samples that were recorded.
        x, v: float64[K], tracked position [m] and velocity [m/s] at each SYNC.
        motor: float64[K], simulated force actual [N].
        level: float64[K], factor on the Coulomb level that the filter found.
    """

    position: F64
    force: F64
    valid: BoolArray
    x: F64
    v: F64
    motor: F64
    level: F64


@numba.njit(cache=True, nogil=True)
def _correct(state, forces, slipping, shares, first, last, innovation, gain, slipped):  # type: ignore[no-untyped-def]
    """Move the simulated axis, whose friction elements are first..last - 1, to the encoder."""
    state.position += gain[0] * innovation
    state.velocity += gain[1] * innovation
    state.wander += gain[4] * innovation
    sticking = 0
    for i in range(first, last):
        if not slipping[i]:
            sticking += 1
    total = 0.0
    for i in range(first, last):
        if slipping[i]:
            forces[i] += gain[3] * innovation * shares[i] / slipped
        else:
            forces[i] += gain[2] * innovation / sticking
        total += forces[i]
    state.friction = total


@numba.njit(cache=True, nogil=True)
def _track(  # type: ignore[no-untyped-def]
    plant, control, state, loop, forces, slipping, shares, arena, period, substeps, ticks,
    demand, offset, measured, reported, valid, wander, keep, noise, doubt, fresh,
    innovation, deviation, motor, x, v, level, gains, transitions, force_inputs, level_inputs,
):  # fmt: skip
    """Track every axis; row k of every array is SYNC k. `fresh`: work out the gains anew."""
    axes = plant.shape[0]
    duration = period * ticks
    # A drive that ticks once per SYNC acts on what was measured only: its loop hides no error.
    closed = 1.0 if ticks > 1 else 0.0
    covariance = np.zeros((axes, STATES, STATES))
    matrix = np.zeros((STATES, STATES))
    spectrum = np.zeros(STATES)
    quiet = np.zeros((axes, 2, 0))
    slipped = np.zeros(axes)
    friction = np.zeros(axes)
    for a in range(axes):
        covariance[a, 4, 4] = wander[a] ** 2
    for k in range(demand.shape[0]):
        for a in range(axes):
            p = plant[a]
            s = state[a]
            e = measured[k, a] - s.position
            innovation[k, a] = e
            motor[k, a] = s.motor_force
            if fresh:
                spread = covariance[a, 0, 0] + noise[a] ** 2
                deviation[k, a] = math.sqrt(spread)
            if valid[k, a]:
                if fresh:
                    for i in range(STATES):
                        gains[k, a, i] = covariance[a, i, 0] / spread
                    for i in range(STATES):
                        for j in range(STATES):
                            covariance[a, i, j] -= gains[k, a, i] * spread * gains[k, a, j]
                _correct(
                    s, forces, slipping, shares, p.first_element, p.first_element + p.elements,
                    e, gains[k, a], slipped[a],
                )  # fmt: skip
                s.encoder = measured[k, a]
                # Between SYNCs the controller saw what nobody knows: its integral wanders off.
                late = (reported[k, a] - s.motor_force) / doubt[a]
                loop[a].integral += _INTEGRAL * doubt[a] * min(max(late, -_LOUD), _LOUD)
            x[k, a] = s.position
            v[k, a] = s.velocity
            level[k, a] = s.wander
            friction[a] = s.friction
            command(loop[a], demand[k, a], offset[k, a], ticks)
        advance(
            plant, control, state, loop, forces, slipping, shares, arena, period, substeps, quiet,
            0, ticks,
        )  # fmt: skip
        for a in range(axes):
            p = plant[a]
            s = state[a]
            before = slipped[a]
            slipped[a] = 0.0
            tangent = 0.0
            for i in range(p.first_element, p.first_element + p.elements):
                if slipping[i]:
                    slipped[a] += shares[i]
                else:
                    tangent += p.element_stiffness
            if not fresh:
                continue
            extra = p.static_ratio * math.exp(-abs(s.velocity) / p.stribeck_velocity)
            relaxation = p.relaxation_rate / (1.0 + extra)
            goal = p.coulomb * (1.0 + extra) * s.direction
            rates(
                matrix, p.mass, p.viscous, closed * control[a].kp,
                closed * _DERIVATIVE_SHARE * control[a].kd,
                tangent, relaxation, goal * slipped[a],
                slipped[a] * p.coulomb * extra / p.stribeck_velocity,
            )  # fmt: skip
            exponential(
                matrix, duration, transitions[k, a], force_inputs[k, a], level_inputs[k, a],
                relaxation * goal * slipped[a], p.mass,
            )  # fmt: skip
            catch(
                transitions[k, a], force_inputs[k, a], level_inputs[k, a], before, slipped[a], goal
            )
            transitions[k, a, 4, 4] = keep[a]
            spectrum[0] = 1e-22
            spectrum[1] = 1e-15
            unsure = (_TRUST * (s.friction - friction[a])) ** 2 + (_DRIFT * p.coulomb) ** 2
            spectrum[2] = (1.0 - slipped[a]) * unsure
            spectrum[3] = slipped[a] * unsure
            spectrum[4] = wander[a] ** 2 * (1.0 - keep[a] ** 2)
            propagate(covariance[a], transitions[k, a], spectrum)


@dataclass(frozen=True, slots=True, eq=False)
class _Run:
    """What the kernel found of K samples and some axes.

    Attributes:
        out: name of `_OUTPUTS` -> float64[K, axes].
        filter: name of `_GAINS` -> float64[K, axes, ...], where gains were worked out.
    """

    out: dict[str, F64]
    filter: dict[str, F64]

    def gains(self, at: int) -> Gains:
        """Of one axis."""
        return Gains(**{name: np.ascontiguousarray(v[:, at]) for name, v in self.filter.items()})


class Tracker:
    """Tracks one axis of a recording under whatever model is asked for.

    Args:
        replay: of the recording.
        settings: nominal, of all its axes.
        axis: which one.
        substeps: plant steps per control tick: 1 is quick, 5 the reference; None: as few
            as are sound.
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
        self.valid = self._valid[:, self._index]

    def finer(self) -> Tracker:
        """The same with the reference's plant steps."""
        other = Tracker(self._replay, self._stage, self.axis.name, SUBSTEPS)
        return other.beside(self._others)

    def beside(self, others: Sequence[AxisSettings]) -> Tracker:
        """The same beside these axes, where an effect feels them; its own is not looked at."""
        other = Tracker(self._replay, self._stage, self.axis.name, self._substeps)
        other._others = tuple(others)
        return other

    def run(
        self, model: AxisSettings, gains: Gains | None = None, fine: float = SUBSTEPS
    ) -> tuple[Track, Gains]:
        """Track the axis under a model of it.

        Args:
            model: of the axis, effects included.
            gains: of an earlier run near this one; None works them out.
            fine: plant steps per control tick that the stage takes, or that it is taken for.

        Raises:
            ValueError: effects that cannot be.
        """
        axes, columns, at = [model], [self._index], 0
        known = None if gains is None else [gains]
        if needs_other_axes(model, self._stage.sync_period):
            axes, columns, at = list(self._others), list(range(len(self._others))), self._index
            axes[at] = model
            if gains is not None:
                known = list(self._of_others)
                known[at] = gains
        run = self._tracked(axes, columns, known, [fine] * len(axes))
        found = gains or run.gains(at)
        return self._seen(run, at, found), found

    def variants(
        self, models: Sequence[AxisSettings], gains: Gains, fines: Sequence[float]
    ) -> list[Track | None]:
        """Track the axis under several models, side by side: each takes little more than half.

        Steps of one fill the time in which another's waits for its own results.

        Args:
            models: of the axis, effects included.
            gains: as in `run`.
            fines: of each model, as in `run`.

        Returns:
            A track for each, None for effects that cannot be.
        """
        found: list[Track | None] = [None] * len(models)
        groups: dict[int, list[int]] = {}
        for i, (model, fine) in enumerate(zip(models, fines, strict=True)):
            try:
                together = needs_other_axes(model, self._stage.sync_period)
            except ValueError:
                continue
            if together:
                found[i] = self._if_possible(model, gains, fine)
            else:
                groups.setdefault(self._steps(fine), []).append(i)
        for group in groups.values():
            axes, columns = [models[i] for i in group], [self._index] * len(group)
            try:
                run = self._tracked(axes, columns, [gains] * len(group), [fines[i] for i in group])
            except ValueError:  # of one of them, and only alone does it tell which
                for i in group:
                    found[i] = self._if_possible(models[i], gains, fines[i])
            else:
                for at, i in enumerate(group):
                    found[i] = self._seen(run, at, gains)
        return found

    def _if_possible(self, model: AxisSettings, gains: Gains, fine: float) -> Track | None:
        try:
            return self.run(model, gains, fine)[0]
        except ValueError:
            return None

    @cached_property
    def _of_others(self) -> list[Gains]:
        """Gains of all axes as they stand beside this one."""
        count = len(self._others)
        run = self._tracked(self._others, list(range(count)), None, [SUBSTEPS] * count)
        return [run.gains(a) for a in range(count)]

    def _steps(self, fine: float) -> int:
        """Plant steps per control tick of a simulation that stands for `fine` ones."""
        return self._substeps if self._substeps < SUBSTEPS else round(fine)

    def _tracked(
        self,
        axes: Sequence[AxisSettings],
        columns: Sequence[int],
        gains: Sequence[Gains] | None,
        fines: Sequence[float],
    ) -> _Run:
        """Track axes of the recording, column by column, or variants of one."""
        stage = replace(self._stage, axes=tuple(replace(a, increment=_FINE) for a in axes))
        demand, offset, measured, reported, valid = (
            np.ascontiguousarray(values[:, columns])
            for values in (
                self._replay.demand, self._replay.offset, self._measured, self._force, self._valid,
            )
        )  # fmt: skip
        count, period = len(demand), stage.sync_period
        steps = self._steps(fines[0])
        arrays = Arrays(stage, demand[0].tolist(), count * period, steps, fine=fines)
        for name in ("offset", "from_force", "to_force"):
            arrays.loop[name] = offset[0]
        arrays.loop["powered"] = True
        for a, axis in enumerate(axes):
            if held := self._replay.rest_force[columns[a]]:
                arrays.balance(a, held, axis)
        friction = [a.friction for a in axes]
        wander = np.array([f.wander for f in friction])
        keep = np.exp(-period / np.array([f.correlation_time for f in friction]))
        noise = np.array(
            [math.hypot(o.noise, o.increment / math.sqrt(12.0)) for o in self._stage.axes]
        )[list(columns)]
        doubt = np.array([force_deviation(a) for a in axes])
        out = {name: np.zeros((count, len(axes))) for name in _OUTPUTS}
        known = 0 if gains is None else count
        fresh = {
            name: np.zeros((count - known, len(axes), *shape)) for name, shape in _GAINS.items()
        }
        gain = fresh["gain"] if gains is None else np.stack([g.gain for g in gains], axis=1)
        _track(
            arrays.plant, arrays.control, arrays.state, arrays.loop, arrays.forces,
            arrays.slipping, arrays.shares, arrays.arena, stage.control_period,
            steps, stage.ticks, demand, offset, measured, reported, valid, wander, keep,
            noise, doubt, gains is None,
            out["innovation"], fresh["deviation"], out["motor"], out["x"], out["v"], out["level"],
            gain, fresh["transition"], fresh["force"], fresh["level"],
        )  # fmt: skip
        return _Run(out, {**fresh, "gain": gain})

    def _seen(self, run: _Run, at: int, gains: Gains) -> Track:
        """One axis of a run."""
        motor = run.out["motor"][:, at]
        return Track(
            position=run.out["innovation"][:, at] / gains.deviation,
            force=(self._force[:, self._index] - motor) / force_deviation(self.axis),
            valid=self.valid,
            x=run.out["x"][:, at],
            v=run.out["v"][:, at],
            motor=motor,
            level=run.out["level"][:, at],
        )


def force_deviation(axis: AxisSettings) -> float:
    """Standard deviation of the force actual value [N].

    Of its rounding, and of the encoder's noise through the controller.
    """
    control = axis.control
    unit = control.rated_force / 1000.0
    gain = control.kp + control.kd / (control.derivative_time + control.period)
    return math.hypot(unit / math.sqrt(12.0), gain * axis.noise)


def needs_other_axes(model: AxisSettings, period: float) -> bool:
    """Whether an effect of this axis feels what the others do."""
    ports = EffectPorts(model, period, period)
    for effect in model.effects:
        effect.apply(ports)
    return bool(ports.coupled_mass or ports.fields)
