"""Curves and library models fitted to the force along a measured motion, judged on other moves.

All compete alike: each is least squares on the force that the machine file leaves, with the plant's
figures within their tolerance beside it, fitted to all but a group of moves and evaluated on that
group. What goes with acceleration and its rate is fitted beside both: a drive reports the force at
an instant, and within a SYNC period it is not constant.

Source: docs/decisions/0019-rivals.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hil_sim.plant import force_variants
from sim2real.fitting import STEP, AxisModel, with_figures
from sim2real.free_loop import derivatives
from sim2real.held_out import FOLDS
from sim2real.open_loop import Motion, MotionLoop
from sim2real.rivals.coordinates import Coordinate, as_curve, columns, courses, find_wave, nodes
from sim2real.rivals.grouped_fit import GroupedFit, Prediction, bends
from stagedata import F64, BoolArray

GROUPS = 2 * FOLDS
"""Groups of moves, there and back together; each belongs to one fold."""
_SMOOTH = (1e-4, 1e-3, 1e-2, 1e-1, 1.0)
"""Weights of the penalty on second differences that are tried."""
_STRAIGHTER = (10.0, 1e2, 1e4)
"""Weights of their magnitude that are tried besides: the last leaves next to none."""
_STRAIGHT = 0.1
"""Bend, as a share of the mean one, below which a curve counts as straight."""
_MORE = 0.01
"""Share of the Coulomb force that is added to see what it does."""
_PER_PERIOD = 5.0
"""Samples per period of the force's cutoff that are compared."""


@dataclass(frozen=True, slots=True, eq=False)
class Linear:
    """A model of the library, linearised.

    Attributes:
        residual: what it leaves of the force over the floor, float64[R].
        figures: derivatives by the plant's figures in sigmas, float64[R, F].
        effects: derivatives by the coordinates of its effects, float64[R, n].
        moved: sigmas that the figures are off the machine file's, float64[F].
    """

    residual: F64
    figures: F64
    effects: F64
    moved: F64

    def with_figures(self, moved: F64) -> Linear:
        """The same with the plant's figures moved by so many sigmas, float64[F], and fixed."""
        none = np.empty((len(self.residual), 0))
        return Linear(self.residual + self.figures @ moved, none, self.effects, np.empty(0))


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """A curve over a coordinate, fitted.

    Attributes:
        coordinate: what it is over.
        at: nodes, float64[n].
        force: at the nodes, float64[n] [N].
        sigma: of the force, float64[n] [N].
        prediction: of other moves.
    """

    coordinate: Coordinate
    at: F64
    force: F64
    sigma: F64
    prediction: Prediction


class Screen:
    """The force of one axis along its motion.

    Args:
        loop: the axis.
    """

    def __init__(self, loop: MotionLoop) -> None:
        self.loop = loop
        motions = loop.motions
        numbers = range(len(motions))
        forces = [(loop.respond_jointly(n, loop.axis)[1], self._friction(n)) for n in numbers]
        self._courses = courses(loop.axis, motions, forces)
        usable = [motion.axes[loop.name].usable for motion in motions]
        self._used = [_thinned(motion, loop.name) for motion in motions]
        parts = [
            (np.zeros(own.sum(), bool), kept[own])
            for own, kept in zip(usable, self._used, strict=True)
        ]
        self._force = np.concatenate([part for pair in parts for part in pair])
        self._scale = [m.floor.rms[loop.name]["force"] for m in loop.measured]
        self._block: NDArray[np.int64] = loop.move[self._force]
        self._group = loop.pair[self._block] % GROUPS
        self._start = loop.residual(loop.start)
        self._residual = self._start[self._force]
        counts = [int(kept.sum()) for kept in self._used]
        self._floors = np.repeat(self._scale, counts)
        share = sum(counts) / max(sum(int(own.sum()) for own in usable), 1)
        self._coherent = max(1.0, share * loop.coherent)
        rates = [self._sampling(number) for number in range(len(motions))]
        self._beside = np.concatenate(rates)
        self._period = motions[0].period * _apart(motions[0], loop.name)

    @cached_property
    def open(self) -> Prediction:
        """The machine file's figures within their tolerance, and no curve."""
        return self.predict(self._plain)

    @cached_property
    def _plain(self) -> Linear:
        """The machine file."""
        slopes = derivatives(self.loop, self.loop.start, self._start, range(STEP))[self._force]
        return Linear(self._residual, slopes, np.empty((len(slopes), 0)), np.zeros(STEP))

    @property
    def samples(self) -> float:
        """Number of samples of the force."""
        return float(len(self._residual))

    @property
    def blocks(self) -> NDArray[np.int64]:
        """Number of the move of each sample of the force, int64[R]."""
        return self._block

    @property
    def force_rms(self) -> float:
        """Rms of the motor force [N]."""
        return self._courses[0].force_rms

    @property
    def floor(self) -> float:
        """Energy (squared deviations over the floor) of a model that leaves nothing but noise."""
        return 2.0 * self.samples

    def closed(self, prediction: Prediction) -> float:
        """How large a share of the gap in force a prediction closes."""
        above = max(self.open.energy - self.floor, 1e-9)
        return (self.open.energy - prediction.energy) / above

    def curve(self, coordinate: Coordinate, beside: Linear | None = None) -> Curve | None:
        """The curve over a coordinate; None where the recordings do not cover it.

        Args:
            coordinate: of the motion.
            beside: a library model that the curve is fitted beside; None: the machine file.
        """
        at = self.nodes(coordinate)
        if at is None:
            return None
        over = self.columns(coordinate, at)
        size = over.shape[1]
        both = over if beside is None else np.column_stack((over, _as_large(beside.effects, over)))
        second = bends(size if coordinate.is_curve else 0, both.shape[1])
        held = (np.arange(both.shape[1]) < size) & coordinate.is_held
        best = self._smoothed(both, second, 0.0, beside, held)
        return Curve(*as_curve(coordinate, at, best.values[:size], best.sigma[:size]), best)

    def nodes(self, coordinate: Coordinate) -> F64 | None:
        """Nodes of a curve, float64[n], in the coordinate's unit.

        None where the recordings do not cover the coordinate.
        """
        if coordinate.along == "wave":
            return self._wave(coordinate)
        return nodes(coordinate, self._courses)

    def extent(self, quantity: str) -> tuple[float, float]:
        """Lowest and highest value of a quantity of the motion where the force is compared.

        In its SI unit (`Course.quantities`).
        """
        pairs = zip(self._courses, self._used, strict=True)
        used = np.concatenate([course.quantities[quantity][own] for course, own in pairs])
        return float(used.min()), float(used.max())

    def columns(self, coordinate: Coordinate, at: F64) -> F64:
        """A curve of unit height at each node, as it shows in the residual, float64[R, n]."""
        each = (columns(coordinate, at, course) for course in self._courses)
        return np.concatenate([self._seen(number, own) for number, own in enumerate(each)])

    def as_linear(self, curve: Curve) -> Linear:
        """The machine file with a curve as its effect, to fit another one beside it."""
        at = self.nodes(curve.coordinate)
        if at is None:
            return self._plain
        return replace(self._plain, effects=self.columns(curve.coordinate, at))

    def forces(self, curve: Curve) -> list[F64]:
        """The force of a curve along the motion of each recording, float64[P] each [N]."""
        at = self.nodes(curve.coordinate)
        if at is None:
            return []
        each = [columns(curve.coordinate, at, course) for course in self._courses]
        return [own @ curve.prediction.values[: own.shape[1]] for own in each]

    def together(self, over: F64, second: F64, small: float, held: BoolArray) -> Prediction:
        """Several curves beside the plant's figures as they are, with the best weight.

        Args:
            over: columns of all curves, float64[R, n].
            second: differences of the heights that bends are, float64[m, n].
            small: weight of each height beside that of the bends.
            held: columns of a curve that shows by its bends only, bool[n].
        """
        none = np.empty((len(self._residual), 0))
        fixed = Linear(self._residual, none, none, np.empty(0))
        return self._smoothed(over, second, small, fixed, held)

    def _smoothed(
        self, over: F64, second: F64, small: float, beside: Linear | None, held: BoolArray
    ) -> Prediction:
        """Curves with the best weight of their bends, which are few.

        First a bend weighs by its square, then by its magnitude: such a penalty leaves curves that
        are straight where nothing bends them.

        Args:
            over: columns of all curves and of what is fitted beside them, float64[R, n].
            second: as of `together`.
            small: as of `together`.
            beside: as of `_fit`.
            held: as of `together`.
        """
        fit = self._fit(over, beside)
        little = small * np.eye(over.shape[1])
        if not len(second):
            return fit.judged([little])
        squared = second.T @ second + little
        values = fit.best([w * squared for w in _SMOOTH])
        fit.hold(held, values)
        bent = np.abs(second @ values[: over.shape[1]])
        mean = max(float(bent.mean()), 1e-12)
        by_size = (second.T * (mean / (bent + _STRAIGHT * mean))) @ second + little
        return fit.judged([w * by_size for w in (*_SMOOTH, *_STRAIGHTER)])

    def linear(self, model: AxisModel) -> Linear | None:
        """A library model and its derivatives; None where it cannot be simulated."""
        (residual,) = self.loop.residuals([model])
        if residual is None:
            return None
        slopes = derivatives(self.loop, model, residual)[self._force]
        base = model.base[:STEP] / self.loop.spread
        return Linear(residual[self._force], slopes[:, :STEP], slopes[:, STEP:], base)

    def model(self, model: AxisModel) -> Prediction | None:
        """A library model, fitted again from where it is; None where it cannot be simulated."""
        linear = self.linear(model)
        return None if linear is None else self.predict(linear)

    def predict(self, linear: Linear) -> Prediction:
        """A library model, fitted again from where it is."""
        size = linear.effects.shape[1]
        return self._fit(linear.effects, linear).judged([np.zeros((size, size))])

    def _friction(self, number: int) -> F64:
        """What a Coulomb force of 1 N adds to the force along the motion, float64[P] [N]."""
        loop, motion = self.loop, self.loop.motions[number]
        moved = motion.axes[loop.name]
        plain = replace(loop.axis, effects=())
        if not plain.friction.coulomb:
            return np.sign(moved.velocity)
        more = with_figures(plain, {"coulomb": (1.0 + _MORE) * plain.friction.coulomb})
        along = moved.position, moved.velocity, moved.acceleration
        force = force_variants(motion.period, [plain, more], along, motion.start)
        return np.asarray(np.diff(force, axis=1)[:, 0] / (_MORE * plain.friction.coulomb))

    def _seen(self, number: int, forces: F64) -> F64:
        """Forces as they show in the residual of a recording, float64[samples, n]."""
        motion, name = self.loop.motions[number], self.loop.name
        low = motion.low_pass(name, forces)
        return np.asarray(-low[self._used[number]] / self._scale[number])

    def _sampling(self, number: int) -> F64:
        course = self._courses[number]
        acceleration = course.quantities["acceleration"]
        forces = np.column_stack((acceleration, np.gradient(acceleration, course.period)))
        return self._seen(number, forces / np.maximum(forces.std(axis=0), 1e-12))

    def _fit(self, over: F64, beside: Linear | None = None) -> GroupedFit:
        """Columns, to be fitted to all groups but one.

        Args:
            over: float64[R, n].
            beside: residual, and figures that are fitted, too; None: those of the machine file.
        """
        beside = beside or self._plain
        return GroupedFit(
            np.column_stack((over, beside.figures, self._beside, beside.residual)),
            self._group, self._block, (GROUPS, len(self.loop.samples)),
            over.shape[1], beside.moved, self._coherent,
        )  # fmt: skip

    def _wave(self, coordinate: Coordinate) -> F64 | None:
        """The wave over time that takes most of the force, as `find_wave`."""
        plain = np.column_stack((self._plain.figures, self._beside))
        weights = np.linalg.lstsq(plain, self._residual, rcond=None)[0]
        force = (self._residual - plain @ weights) * self._floors
        return find_wave(coordinate, self._courses, self._used, force, self._period)


def _as_large(columns: F64, others: F64) -> F64:
    """Columns scaled to the mean square of others: a penalty on all of them weighs alike."""
    mean = math.sqrt(float(np.mean(others**2)))
    return np.asarray(columns * (mean / np.maximum(np.sqrt(np.mean(columns**2, axis=0)), 1e-12)))


def _apart(motion: Motion, name: str) -> int:
    """Samples from one to the next that is compared: a low-passed force has no more to say."""
    return max(1, int(1.0 / (_PER_PERIOD * motion.axes[name].cutoff * motion.period)))


def _thinned(motion: Motion, name: str) -> BoolArray:
    """The samples of an axis whose force is compared, bool[P]."""
    usable = motion.axes[name].usable
    return np.asarray(usable & (np.arange(len(usable)) % _apart(motion, name) == 0))
