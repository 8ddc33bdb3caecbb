"""Curves and library models fitted to the force along a measured motion, judged on other moves.

All compete alike: each is least squares on the force that the machine file leaves, with the plant's
figures within their tolerance beside it, fitted to all but a group of moves and evaluated on that
group. What goes with acceleration and its rate is fitted beside both: a drive reports the force at
an instant, and within a SYNC period it is not constant.

Source: docs/decisions/0019-rivals.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dposv

from hil_sim.plant import force_variants
from sim2real.fitting import MAX_SIGMAS, STEP, AxisModel, with_figures
from sim2real.free_loop import derivatives
from sim2real.held_out import FOLDS
from sim2real.open_loop import Motion, MotionLoop
from sim2real.rivals.coordinates import Coordinate, as_curve, columns, courses, find_wave, nodes
from stagedata import F64, BoolArray

GROUPS = 2 * FOLDS
"""Groups of moves, there and back together; each belongs to one fold."""
_SMOOTH = (1e-4, 1e-3, 1e-2, 1e-1, 1.0)
"""Weights of the penalty on second differences that are tried."""
_STRAIGHT = 0.1
"""Bend, as a share of the mean one, below which a curve counts as straight."""
_MORE = 0.01
"""Share of the Coulomb force that is added to see what it does."""
_PER_PERIOD = 5.0
"""Samples per period of the force's cutoff that are compared."""
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


@dataclass(frozen=True, slots=True, eq=False)
class _Fit:
    """Columns with their squares, fitted to all groups but one and judged on that one.

    Attributes:
        parts: columns, figures, what goes with acceleration, and the residual, of each group.
        blocks: number of the move of each sample of a group.
        squares: of the parts.
        size: number of the columns.
        moved: sigmas that the figures behind them are off, float64[F].
        coherent: samples that count as one.
        moves: their number.
    """

    parts: tuple[F64, ...]
    blocks: tuple[NDArray[np.int64], ...]
    squares: tuple[F64, ...]
    size: int
    moved: F64
    coherent: float
    moves: int

    def best(self, penalties: Sequence[F64]) -> F64:
        """Values fitted to all moves with the best of these penalties, as of `judged`."""
        prior, _, _ = self._chosen(penalties)
        return self._values(np.sum(self.squares, axis=0), prior)

    def judged(self, penalties: Sequence[F64]) -> Prediction:
        """The prediction with the best of these penalties.

        Args:
            penalties: float64[n, n] per sample and squared column, each.
        """
        prior, energies, folds = self._chosen(penalties)
        total = np.sum(self.squares, axis=0)
        samples = sum(map(len, self.parts))
        noise = self.coherent * max(float(energies.sum()) / max(samples, 1), 1.0)
        inverse = np.linalg.inv(_normal(total, prior))
        sigma = np.sqrt(np.maximum(noise * np.diag(inverse), 0.0))
        return Prediction(energies, self._values(total, prior), sigma, folds)

    def _chosen(self, penalties: Sequence[F64]) -> tuple[F64, F64, tuple[F64, ...]]:
        """The best penalty as a prior of all values, energies of the moves, and values by group."""
        total = np.sum(self.squares, axis=0)
        mean = max(float(np.trace(total[: self.size, : self.size])) / max(self.size, 1), 1e-12)
        plain = np.zeros((len(total) - 1, len(total) - 1))
        plain[self._own, self._own] = self.coherent * np.eye(len(self.moved))
        priors = []
        for penalty in penalties:
            there = plain.copy()
            there[: self.size, : self.size] += mean * (penalty + _LITTLE * np.eye(self.size))
            priors.append(there)
        energies = np.zeros((self.moves, len(priors)))
        folds = []
        for part, block, square in zip(self.parts, self.blocks, self.squares, strict=True):
            values = [self._values(total - square, there) for there in priors]
            folds.append(values)
            first = np.flatnonzero(np.diff(block, prepend=-1))
            if len(first):
                left = (part[:, :-1] @ np.transpose(values) + part[:, -1:]) ** 2
                energies[block[first]] = np.add.reduceat(left, first)
        best = int(energies.sum(axis=0).argmin())
        return priors[best], energies[:, best], tuple(values[best] for values in folds)

    @property
    def _own(self) -> slice:
        """The figures among the values."""
        return slice(self.size, self.size + len(self.moved))

    def _values(self, squares: F64, prior: F64) -> F64:
        held = np.zeros(len(prior))
        held[self._own] = self.coherent * self.moved
        bounds = self._own, -MAX_SIGMAS - self.moved, MAX_SIGMAS - self.moved
        return _solve(squares, prior, held, bounds)


class Screen:
    """The force of one axis along its motion.

    Args:
        loop: the axis.
    """

    def __init__(self, loop: MotionLoop) -> None:
        self.loop = loop
        name, motions = loop.name, loop.motions
        numbers = range(len(motions))
        forces = [(loop.respond_jointly(n, loop.axis)[1], self._friction(n)) for n in numbers]
        self._courses = courses(name, motions, forces, loop.axis.friction.relaxation_rate)
        usable = [motion.axes[name].usable for motion in motions]
        self._used = [_thinned(motion, name) for motion in motions]
        parts = [
            (np.zeros(own.sum(), bool), kept[own])
            for own, kept in zip(usable, self._used, strict=True)
        ]
        self._force = np.concatenate([part for pair in parts for part in pair])
        self._scale = [m.floor.rms[name]["force"] for m in loop.measured]
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
        self._period = motions[0].period * _apart(motions[0], name)

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
        both = over if beside is None else np.column_stack((over, beside.effects))
        second = bends(size if coordinate.is_curve else 0, both.shape[1])
        best = self._smoothed(both, second, 0.0, beside)
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

    def together(self, over: F64, second: F64, small: float) -> Prediction:
        """Several curves beside the plant's figures as they are, with the best weight.

        Args:
            over: columns of all curves, float64[R, n].
            second: differences of the heights that bends are, float64[m, n].
            small: weight of each height beside that of the bends.
        """
        none = np.empty((len(self._residual), 0))
        fixed = Linear(self._residual, none, none, np.empty(0))
        return self._smoothed(over, second, small, fixed)

    def _smoothed(self, over: F64, second: F64, small: float, beside: Linear | None) -> Prediction:
        """Curves with the best weight of their bends, which are few.

        First a bend weighs by its square, then by its magnitude: such a penalty leaves curves that
        are straight where nothing bends them.

        Args:
            over: columns of all curves and of what is fitted beside them, float64[R, n].
            second: as of `together`.
            small: as of `together`.
            beside: as of `_fit`.
        """
        fit = self._fit(over, beside)
        held = small * np.eye(over.shape[1])
        if not len(second):
            return fit.judged([held])
        squared = second.T @ second + held
        values = fit.best([w * squared for w in _SMOOTH])
        bent = np.abs(second @ values[: over.shape[1]])
        mean = max(float(bent.mean()), 1e-12)
        by_size = (second.T * (mean / (bent + _STRAIGHT * mean))) @ second + held
        return fit.judged([w * by_size for w in (*_SMOOTH, 10.0)])

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

    def _fit(self, over: F64, beside: Linear | None = None) -> _Fit:
        """Columns, to be fitted to all groups but one.

        Args:
            over: float64[R, n].
            beside: residual, and figures that are fitted, too; None: those of the machine file.
        """
        beside = beside or self._plain
        both = np.column_stack((over, beside.figures, self._beside, beside.residual))
        parts = tuple(both[self._group == group] for group in range(GROUPS))
        blocks = tuple(self._block[self._group == group] for group in range(GROUPS))
        squares = tuple(part.T @ part for part in parts)
        size, moves = over.shape[1], len(self.loop.samples)
        return _Fit(parts, blocks, squares, size, beside.moved, self._coherent, moves)

    def _wave(self, coordinate: Coordinate) -> F64 | None:
        """The wave over time that takes most of the force, as `find_wave`."""
        plain = np.column_stack((self._plain.figures, self._beside))
        weights = np.linalg.lstsq(plain, self._residual, rcond=None)[0]
        force = (self._residual - plain @ weights) * self._floors
        return find_wave(coordinate, self._courses, self._used, force, self._period)


def _apart(motion: Motion, name: str) -> int:
    """Samples from one to the next that is compared: a low-passed force has no more to say."""
    return max(1, int(1.0 / (_PER_PERIOD * motion.axes[name].cutoff * motion.period)))


def _thinned(motion: Motion, name: str) -> BoolArray:
    """The samples of an axis whose force is compared, bool[P]."""
    usable = motion.axes[name].usable
    return np.asarray(usable & (np.arange(len(usable)) % _apart(motion, name) == 0))


def _solve(squares: F64, prior: F64, held: F64, bounds: tuple[slice, F64, F64]) -> F64:
    """Values that minimise |columns x + residual|^2 + the prior's cost within bounds, float64[n].

    Args:
        squares: of columns and residual, float64[n + 1, n + 1].
        prior: float64[n, n].
        held: slope of the prior's cost at 0, float64[n].
        bounds: which values have a lowest and a highest one, and these.
    """
    normal, slope = _normal(squares, prior), squares[:-1, -1] + held
    own, low, high = bounds
    free = np.ones(len(slope), dtype=np.bool_)
    values = -_solve_positive(normal, slope)
    while True:
        within = np.clip(values[own], low, high)
        beyond = np.flatnonzero(within != values[own]) + own.start
        if not len(beyond):
            return values
        values[own], free[beyond] = within, False
        there = (slope + normal[:, ~free] @ values[~free])[free]
        values[free] = -_solve_positive(normal[np.ix_(free, free)], there)


def _normal(squares: F64, prior: F64) -> F64:
    """Normal equations with a ridge that hardly counts, float64[n, n]."""
    normal = squares[:-1, :-1] + prior
    normal.flat[:: len(normal) + 1] += 1e-12 * np.diag(normal) + 1e-300
    return normal


def _solve_positive(normal: F64, slope: F64) -> F64:
    """Solution of normal equations, by Cholesky unless rounding has spoiled them."""
    _, values, failed = dposv(normal.T, slope)
    return np.asarray(np.linalg.solve(normal, slope) if failed else values)


def bends(bent: int, size: int) -> F64:
    """Second differences of the first `bent` of `size` heights, float64[bent - 2, size]."""
    return np.diff(np.eye(bent, size), 2, axis=0) if bent > 2 else np.empty((0, size))
