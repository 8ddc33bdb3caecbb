"""Models compared with a recording along its motion: what each leaves of the force.

The search of the free loop (`sim2real.free_loop`) runs on it unchanged: it asks for the residual of
a model, here of the force alone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hil_sim.plant import force_along, force_variants
from hil_sim.settings import AxisSettings, StageSettings
from sim2real.findings import GapFigures
from sim2real.fitting import Workers
from sim2real.free_loop import FreeLoop
from sim2real.gap import Floor, Measured, Replay, Signals, rms
from sim2real.open_loop.motion import Motion
from sim2real.open_loop.repeats import scatter_of_repeats
from stagedata import F64

_WANDER = 0.01
"""Wander of the Coulomb force where the machine file states none and no strokes repeat: few sliding
guides repeat better, and a floor of noise alone would make every model look hopeless."""
_SEED = 1


def compare_along(motion: Motion, settings: StageSettings) -> Measured:
    """The gap in force of a model against a recording, and its floor.

    The floor combines the noise of the low-passed force and of mass times acceleration, friction's
    wander (where the machine file states none, that of strokes that repeat), and the force unit's
    rounding. Positions are the motion itself: their residual is zero
    and they have no gap.

    Args:
        motion: of the recording.
        settings: of the model.
    """
    names = [axis.name for axis in settings.axes]
    count = len(motion.recording)
    position, force = _forces_along(motion, settings)
    rng = np.random.default_rng(_SEED)
    nominal: Signals = {}
    residual: Signals = {}
    drawn: Signals = {}
    floors: dict[str, dict[str, float]] = {}
    gap: dict[str, dict[str, GapFigures]] = {}
    rest = np.zeros(count)
    for a, (name, axis) in enumerate(zip(names, settings.axes, strict=True)):
        moved = motion.axes[name]
        simulated = motion.low_pass(name, force[:, a])
        nominal[name] = {"position": moved.position, "force": simulated}
        residual[name] = {"position": rest, "force": moved.force - simulated}
        noise = motion.noise_of(name, force[:, a])
        wander = axis.wander * axis.friction.coulomb
        if not wander:
            scatter = scatter_of_repeats(motion, name, residual[name]["force"])
            assumed = _WANDER * axis.friction.coulomb
            wander = assumed if scatter is None else math.sqrt(max(scatter**2 - noise**2, 0.0))
        floor = math.hypot(noise, wander, axis.control.rated_force / 1000.0 / math.sqrt(12.0))
        floors[name] = {"position": 0.0, "force": floor}
        white = motion.low_pass(name, rng.standard_normal(count))
        drawn[name] = {"position": rest, "force": white * (floor / float(np.std(white)))}
        if moved.usable.any():
            there = rms(residual[name]["force"], moved.usable)
            gap[name] = {"force": GapFigures(there, floor, axis.unit_of("N"))}
    replay = Replay(
        motion.recording, tuple(names), motion.period, position, np.zeros_like(position),
        np.arange(count), (0.0,) * len(names), {name: {} for name in names}, motion.start,
    )  # fmt: skip
    return Measured(replay, Floor(nominal, (drawn,), floors), residual, gap, {})


def _forces_along(motion: Motion, settings: StageSettings) -> tuple[F64, F64]:
    """Positions [m] and forces [N] of all axes, not low-passed, float64[P, axes] each."""
    axes = [motion.axes[axis.name] for axis in settings.axes]
    position = np.column_stack([axis.position for axis in axes])
    velocity = np.column_stack([axis.velocity for axis in axes])
    acceleration = np.column_stack([axis.acceleration for axis in axes])
    stage = replace(settings, start=motion.start)
    return position, force_along(stage, (position, velocity, acceleration))


class MotionLoop(FreeLoop):
    """One axis under models along its measured motion, in place of the free loop.

    The residual has both parts that the free loop's has, so that its thresholds hold. That of the
    position is 0; that of the force is weighted by sqrt(2), which leaves the squared gap over floor
    at 2 where nothing but noise is left.

    Args:
        name: of the axis.
        motions: of the recordings.
        settings: of the machine file.
        tolerance: relative standard deviation of the base parameters.
        workers: threads that the models are shared among.
        known: as of `FreeLoop`.

    Attributes:
        motions: of the recordings.
    """

    diverged = 1e9  # nothing runs away: a force that is missing may be as large as it likes

    def __init__(
        self,
        name: str,
        motions: Sequence[Motion],
        settings: StageSettings,
        tolerance: float,
        workers: Workers | None = None,
        known: Sequence[F64] = (),
    ) -> None:
        self.motions = tuple(motions)
        measured = [_for_force_alone(compare_along(m, settings), name) for m in motions]
        super().__init__(name, measured, settings, tolerance, workers, known)

    def respond(self, number: int, variants: Sequence[AxisSettings]) -> tuple[F64, F64]:
        """As `FreeLoop.respond`, along the measured motion, float64[P, variants] each [m, N]."""
        motion = self.motions[number]
        moved = motion.axes[self.name]
        force = force_variants(
            motion.period,
            [self._beside_known(number, variant) for variant in variants],
            (moved.position, moved.velocity, moved.acceleration),
            motion.start,
        )
        position = np.broadcast_to(moved.position[:, None], force.shape)
        return position, motion.low_pass(self.name, force)

    def respond_jointly(self, number: int, axis: AxisSettings) -> tuple[F64, F64]:
        """As `FreeLoop.respond_jointly`, along the measured motion, float64[P] each [m, N]."""
        motion, axis = self.motions[number], self._beside_known(number, axis)
        axes = tuple(axis if a.name == self.name else a for a in self.settings.axes)
        _, force = _forces_along(motion, replace(self.settings, axes=axes))
        at = [a.name for a in axes].index(self.name)
        return motion.axes[self.name].position, motion.low_pass(self.name, force[:, at])


def _for_force_alone(measured: Measured, name: str) -> Measured:
    """The same with the floor of one axis' force divided by sqrt(2), as position does not count."""
    floors = dict(measured.floor.rms)
    floors[name] = {"position": 1.0, "force": floors[name]["force"] / math.sqrt(2.0)}
    return replace(measured, floor=replace(measured.floor, rms=floors))
