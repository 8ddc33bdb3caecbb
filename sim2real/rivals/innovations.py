"""Curves fitted to innovations: they know coordinates that friction's wander hides in the force.

The filter that keeps a simulation on the recorded course follows the level of friction. What a
force over one coordinate leaves in its innovations follows to first order, as that of the library's
effects does. Curves are judged on parts of the recording that took no part in their fit.

Source: docs/decisions/0019-rivals.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property

import numpy as np

from sim2real.findings import ForceCurve, Unlisted
from sim2real.fitting import AxisModel, AxisProblem, fit
from sim2real.held_out import share_closed
from sim2real.rivals.coordinates import COORDINATES, Coordinate, Course, as_curve, columns, nodes
from sim2real.rivals.grouped_fit import GroupedFit, Prediction, bends
from sim2real.scoring.constants import SURE_COORDINATE
from sim2real.tracking import innovation_response
from stagedata import F64

_PARTS, _LENGTH = 8, 500
"""Parts of the recording, which take turns, and samples of a turn."""
_SMOOTH = (1e-4, 1e-2, 1.0, 1e2)
"""Weights of the penalty on second differences that are tried."""
_CLEARLY = 0.5
"""What a curve may leave of what library effects leave, to take their names away."""
_SHOWN, _AHEAD = 0.75, 3.0
"""What a curve may leave to be an answer; and by how much its odds, of what it explains to what it
leaves, have to exceed the next coordinate's."""


class Innovations:
    """The innovations of one axis under the machine file.

    Shares are of the energy beyond noise that the machine file's figures leave.

    Args:
        problem: the axis.
    """

    def __init__(self, problem: AxisProblem) -> None:
        self._problem = copy(problem)
        self._problem.retune(problem.start)
        plain = self._problem.nominal_fit()
        self._problem.rescale(plain.residual)
        left = self._problem.positions(plain.residual)
        self._root = np.sqrt(self._problem.weights(left))
        self._target = left * self._root
        figures = self._problem.base_columns(plain.model, plain.residual)[: len(left)]
        self._figures = figures * self._problem.spread * self._root[:, None]
        self._turn = np.arange(len(left)) // _LENGTH
        self._noise = self._problem.noise_energy * self._by_turn(self._root)
        self._open = self._fitted(np.empty((len(self._target), 0)))

    @cached_property
    def _ranking(self) -> Sequence[tuple[float, Coordinate, F64, Prediction]]:
        """The best curve over each coordinate: what share it leaves, its nodes and fit.

        The best first. What changes sign with friction is not among them: the filter follows it.
        """
        ranked: dict[str, tuple[float, Coordinate, F64, Prediction]] = {}
        courses = self._courses()
        for coordinate in COORDINATES:
            at = None if coordinate.times == "friction" else nodes(coordinate, courses)
            if at is None:
                continue
            over = self._columns(coordinate, at, courses)
            found = self._fitted(over, coordinate)
            share = self._share(found.energy)
            if coordinate.over not in ranked or share < ranked[coordinate.over][0]:
                ranked[coordinate.over] = share, coordinate, at, found
        return sorted(ranked.values(), key=lambda each: each[0])

    def unlisted(self) -> tuple[Unlisted, ...]:
        """The coordinate that explains much and far more than any other; none without one."""
        (left, coordinate, at, fitted), (second, *_) = self._ranking[:2]
        if left >= _SHOWN or _AHEAD * left * (1.0 - second) >= (1.0 - left) * second:
            return ()
        energies = self._open.energies, fitted.energies, self._noise
        share, interval = share_closed(*(energy[:, None] for energy in energies))
        if share is None or interval is None or interval[0] <= 0.0:
            return ()
        own = slice(-self._figures.shape[1])
        coordinate, *curve = as_curve(coordinate, at, fitted.values[own], fitted.sigma[own])
        force = ForceCurve(*(tuple(part.tolist()) for part in curve))
        found = Unlisted(
            self._problem.axis.name, coordinate.over, (), min(SURE_COORDINATE, share), share,
            interval, force, coordinate.times, seen_in="innovations",
        )  # fmt: skip
        return (found,)

    def instead_of(self, models: Sequence[AxisModel]) -> tuple[Unlisted, ...]:
        """The coordinate that stands out, if a curve over it explains clearly more than these.

        Args:
            models: of the library; those without effects do not count.
        """
        named = [model for model in models if model.terms]
        found = self.unlisted()
        if not found or not named:
            return ()
        least = min(self._left_by(model) for model in named)
        # A right one leaves as little as noise, which may be less than nothing.
        return found if max(self._ranking[0][0], 0.0) < _CLEARLY * least else ()

    def _left_by(self, model: AxisModel) -> float:
        """Share that a library model leaves, fitted."""
        residual = fit(self._problem, model, 1, thorough=False).residual
        left = self._problem.positions(residual) * self._root
        return self._share(float(left @ left))

    def _share(self, energy: float) -> float:
        noise = float(self._noise.sum())
        return (energy - noise) / max(self._open.energy - noise, 1e-9)

    def _by_turn(self, values: F64) -> F64:
        """Energy in each turn, float64[turns]."""
        return np.asarray(np.bincount(self._turn, np.square(values)), np.float64)

    def _courses(self) -> list[Course]:
        """What the axis does in each recording, as the filter followed it."""
        forces = [np.asarray(track.motor, np.float64) for track in self._problem.tracks]
        rms = max(float(np.std(np.concatenate(forces))), 1e-12)
        found: list[Course] = []
        for track, tracker in zip(self._problem.tracks, self._problem.trackers, strict=True):
            period = float(tracker.time[1])
            quantities = {
                "position": track.x,
                "velocity": track.v,
                "acceleration": np.gradient(track.v, period),
                "force": forces[len(found)],
                "time": tracker.time,
            }
            plain = replace(self._problem.axis, effects=())
            found.append(Course(quantities, None, 0.0, period, plain, rms))
        return found

    def _columns(self, coordinate: Coordinate, at: F64, courses: Sequence[Course]) -> F64:
        """What a force of unit height at each node leaves, weighted, float64[R, n]."""
        parts = []
        for course, gains, mask in zip(
            courses, self._problem.gains, self._problem.masks, strict=True
        ):
            each = columns(coordinate, at, course).T
            parts.append([innovation_response(gains, gains.force, own)[mask] for own in each])
        return np.concatenate([np.transpose(part) for part in parts]) * self._root[:, None]

    def _fitted(self, over: F64, coordinate: Coordinate | None = None) -> Prediction:
        """Columns beside the plant's figures, with the best weight of their bends.

        Args:
            over: weighted, float64[R, n].
            coordinate: that they are over; None without any.
        """
        size = over.shape[1]
        is_curve = coordinate is not None and coordinate.is_curve
        second = bends(size if is_curve else 0, size)
        fit_by_part = GroupedFit(
            np.column_stack((over, self._figures, self._target)),
            self._turn % _PARTS, self._turn, (_PARTS, len(self._noise)),
            over.shape[1], np.zeros(self._figures.shape[1]), 1.0,
        )  # fmt: skip
        weights = _SMOOTH if is_curve else _SMOOTH[:1]
        penalties = [weight * second.T @ second for weight in weights]
        if coordinate is not None and coordinate.is_held:
            fit_by_part.hold(np.full(size, True), fit_by_part.best(penalties))
        return fit_by_part.judged(penalties)
