"""Curves and library models fitted to the force along a measured motion, judged on other moves.

All compete alike: each is least squares on the force that the machine file leaves, with the plant's
figures within their tolerance beside it, fitted to all but a group of moves and evaluated on that
group. What goes with acceleration and its rate is fitted beside both: a drive reports the force at
an instant, and within a SYNC period it is not constant.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from sim2real.fitting import STEP, AxisModel
from sim2real.free_loop import derivatives
from sim2real.held_out import FOLDS
from sim2real.open_loop import MotionLoop
from sim2real.rivals.coordinates import Coordinate, as_curve, columns, courses, nodes
from stagedata import F64

GROUPS = 2 * FOLDS
"""Groups of moves, there and back together; each belongs to one fold."""
_SMOOTH = (1e-4, 1e-3, 1e-2, 1e-1, 1.0)
"""Weights of the penalty on second differences that are tried."""
_LITTLE = 1e-6
"""Weight of the penalty on every height, which keeps what was hardly passed at 0."""


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """How well something predicts moves that it was not fitted to.

    Attributes:
        energies: squared residual over floor of each move, float64[moves].
        values: fitted to all moves, in the order of its columns.
        sigma: of these.
        folds: fitted to all moves but those of each of `GROUPS`.
    """

    energies: F64
    values: F64
    sigma: F64
    folds: tuple[F64, ...]

    @property
    def energy(self) -> float:
        """Of all moves."""
        return float(self.energies.sum())


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
        name, motions = loop.name, loop.motions
        forces = [loop.respond_jointly(n, loop.axis)[1] for n in range(len(motions))]
        self._courses = courses(name, motions, forces, loop.axis.friction.relaxation_rate)
        self._used = [motion.axes[name].usable for motion in motions]
        counts = [int(used.sum()) for used in self._used]
        parts = [np.repeat((False, True), count) for count in counts]
        self._force = np.concatenate(parts)
        self._scale = [m.floor.rms[name]["force"] for m in loop.measured]
        self._block: NDArray[np.int64] = loop.move[self._force]
        self._group = loop.pair[self._block] % GROUPS
        self._start = loop.residual(loop.start)
        self._residual = self._start[self._force]
        rates = [self._sampling(number) for number in range(len(motions))]
        self._beside = np.concatenate(rates)

    @cached_property
    def open(self) -> Prediction:
        """The machine file's figures within their tolerance, and no curve."""
        return self._predict(np.empty((len(self._residual), 0)), self._residual, [np.empty((0, 0))])

    @cached_property
    def _base(self) -> F64:
        """Derivatives by the plant's figures in sigmas, float64[R, STEP]."""
        slopes = derivatives(self.loop, self.loop.start, self._start, range(STEP))
        return np.asarray(slopes[self._force])

    @property
    def samples(self) -> float:
        """Number of samples of the force."""
        return float(len(self._residual))

    @property
    def blocks(self) -> NDArray[np.int64]:
        """Number of the move of each sample of the force, int64[R]."""
        return self._block

    @property
    def floor(self) -> float:
        """Energy of a model that leaves nothing but noise."""
        return 2.0 * self.samples

    def closed(self, prediction: Prediction) -> float:
        """Share of the gap in force that a prediction closes."""
        above = max(self.open.energy - self.floor, 1e-9)
        return (self.open.energy - prediction.energy) / above

    def curve(self, coordinate: Coordinate) -> Curve | None:
        """The curve over a coordinate; None where the recordings do not cover it."""
        at = self.nodes(coordinate)
        if at is None:
            return None
        over = self.columns(coordinate, at)
        size = over.shape[1]
        penalty = bending(size if coordinate.is_curve else 0, size)
        tried = _SMOOTH if coordinate.is_curve else _SMOOTH[:1]
        best = self._predict(over, self._residual, [weight * penalty for weight in tried])
        return Curve(*as_curve(coordinate, at, best.values[:size], best.sigma[:size]), best)

    def nodes(self, coordinate: Coordinate) -> F64 | None:
        """Nodes of a curve, float64[n]; None where the recordings do not cover its coordinate."""
        return nodes(coordinate, self._courses)

    def extent(self, quantity: str) -> tuple[float, float]:
        """Lowest and highest value of a quantity of the motion where the force is compared."""
        pairs = zip(self._courses, self._used, strict=True)
        used = np.concatenate([course.quantities[quantity][own] for course, own in pairs])
        return float(used.min()), float(used.max())

    def columns(self, coordinate: Coordinate, at: F64) -> F64:
        """A curve of unit height at each node, as it shows in the residual, float64[R, n]."""
        each = (columns(coordinate, at, course) for course in self._courses)
        return np.concatenate([self._seen(number, own) for number, own in enumerate(each)])

    def together(self, over: F64, penalty: F64) -> Prediction:
        """Several curves beside the plant's figures as they are, with the best weight.

        Args:
            over: columns of all curves, float64[R, n].
            penalty: on their bends, float64[n, n].
        """
        none = np.empty((len(self._residual), 0))
        return self._predict(over, self._residual, [w * penalty for w in _SMOOTH], none)

    def model(self, model: AxisModel) -> Prediction | None:
        """A library model; its figures are fitted again from where they are.

        None where it cannot be simulated.
        """
        loop = self.loop
        if not loop.allows(model):
            return None
        residual = loop.residual(model)
        slopes = derivatives(loop, model, residual)[self._force]
        base = model.base[:STEP] / loop.spread
        effects, figures = slopes[:, STEP:], slopes[:, :STEP]
        none = np.zeros((effects.shape[1], effects.shape[1]))
        return self._predict(effects, residual[self._force], [none], figures, base)

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

    def _predict(
        self,
        over: F64,
        residual: F64,
        penalties: Sequence[F64],
        base: F64 | None = None,
        moved: F64 | None = None,
    ) -> Prediction:
        """Fit columns to all groups but one, evaluate that one; the best of several penalties.

        Args:
            over: float64[R, n].
            residual: float64[R].
            penalties: float64[n, n] per sample and squared column, each.
            base: derivatives by the plant's figures in sigmas, float64[R, F]; None: those of the
                machine file.
            moved: by how many sigmas these figures have been moved already, float64[F].
        """
        size, coherent = over.shape[1], self.loop.coherent
        base = self._base if base is None else base
        both = np.column_stack((over, base, self._beside, residual))
        parts = [both[self._group == group] for group in range(GROUPS)]
        squares = [part.T @ part for part in parts]
        total = np.sum(squares, axis=0)
        figures = base.shape[1]
        own = slice(size, size + figures)
        prior = np.zeros((len(total) - 1, len(total) - 1))
        prior[own, own] = coherent * np.eye(figures)
        held = np.zeros(len(prior))
        held[own] = 0.0 if moved is None else coherent * moved
        mean = max(float(np.trace(total[:size, :size])) / max(size, 1), 1e-12)

        def evaluated(penalty: F64) -> tuple[float, F64, F64]:
            """Energy left of all groups, energies of the moves, and the prior."""
            there = prior.copy()
            there[:size, :size] += mean * (penalty + _LITTLE * np.eye(size))
            energies = np.zeros(len(self.loop.samples))
            for group, part in enumerate(parts):
                left = part @ np.append(_solve(total - squares[group], there, held), 1.0)
                block = self._block[self._group == group]
                energies += np.bincount(block, left**2, len(energies))
            return float(energies.sum()), energies, there

        energy, energies, prior = min(map(evaluated, penalties), key=lambda each: each[0])
        inverse = np.linalg.pinv(total[:-1, :-1] + prior, hermitian=True)
        noise = coherent * max(energy / max(len(residual), 1), 1.0)
        sigma = np.sqrt(np.maximum(noise * np.diag(inverse), 0.0))
        folds = tuple(_solve(total - own, prior, held) for own in squares)
        return Prediction(energies, _solve(total, prior, held), sigma, folds)


def _solve(squares: F64, prior: F64, held: F64) -> F64:
    """Values that minimise |columns x + residual|^2 + the prior's cost, float64[n]."""
    normal = squares[:-1, :-1] + prior
    size = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    scaled = normal / np.outer(size, size) + 1e-12 * np.eye(len(size))
    return np.asarray(-np.linalg.solve(scaled, (squares[:-1, -1] + held) / size) / size)


def bending(bent: int, size: int) -> F64:
    """Squared second differences of the first `bent` of `size` heights."""
    penalty = np.zeros((size, size))
    if bent > 2:
        second = np.diff(np.eye(bent), 2, axis=0)
        penalty[:bent, :bent] = second.T @ second
    return penalty
