"""What curves do beside library effects: which of these they take, and which they leave.

An effect may stand for a force that no effect has, or explain the axis together with one. A curve
is fitted beside effects as it is alone; it takes the place of those without which the rest and the
curve predict other moves as well, and of several that it predicts better than.

Source: docs/decisions/0019-rivals.md.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

from sim2real.findings import Unlisted
from sim2real.fitting import AxisModel
from sim2real.free_loop import is_certain
from sim2real.rivals.coordinates import COORDINATES
from sim2real.rivals.decision import CLEARLY, FAINT, Rivals, compare, fit_curves, losses, pitches
from sim2real.rivals.grouped_fit import Prediction
from sim2real.rivals.screen import Curve
from sim2real.scoring.constants import ENOUGH, LITTLE, NEAR

_TAKEN = 0.1
"""Share of what an effect closes that may be lost where a curve takes its place."""
_FORCES = ("force", "friction")
"""Groups of effects that show along the motion where they are not small."""


class Beside:
    """Curves beside effects of an axis.

    Args:
        rivals: the curves alone.
    """

    def __init__(self, rivals: Rivals) -> None:
        self._rivals = rivals
        self._screen = rivals.screen

    def doubts(
        self, model: AxisModel, kept: Sequence[str] = ()
    ) -> tuple[tuple[str, ...], tuple[Unlisted, ...]]:
        """Effects of a model that are not needed beside the best curve, and that curve.

        Nothing of either where the model leaves little, or no curve beside it closes most of that.
        No curve takes the place of effects that are `kept`. It takes that of `shapes`, and of what
        another effect's shape may lack, in any case. A curve is given where it closes a fiftieth of
        the whole gap.
        """
        dropped = list(dict.fromkeys([*self._rivals.shapes(model), *self._misfits(model)]))
        model = _without(model, dropped)
        found = self.curves(model)
        best = None if found is None else found.best
        if found is None or best is None:
            return tuple(dropped), ()
        while model.terms:
            tried, whole = [], self._screen.model(model)
            for index in range(len(model.terms)):
                if model.terms[index].name in kept:
                    continue
                rest = self._screen.linear(model.without(index))
                curve = None if rest is None else self._screen.curve(best.coordinate, rest)
                if rest is None or curve is None or whole is None:
                    continue
                loss, error = compare(curve.prediction, best.prediction)
                work = self._screen.predict(rest).energy - whole.energy
                tried.append((loss - max(found.margin(error), _TAKEN * work), index))
            excess, index = min(tried, default=(math.inf, 0))
            if excess > 0.0:
                break
            dropped.append(model.terms[index].name)
            model = model.without(index)
        found = self.curves(model) if dropped else found
        least = LITTLE * (self._rivals.opened.energy - self._screen.floor)
        if found is None or found.gained < least:
            return tuple(dropped), ()
        return tuple(dropped), found.unlisted(self._screen.loop.name)

    def doubts_of_complete(self, model: AxisModel) -> tuple[tuple[str, ...], tuple[Unlisted, ...]]:
        """Effects of a complete model that are none, and the curve that takes their place."""
        together = self.taken_together(model)
        found = self.curves(_without(model, together)) if together else None
        unlisted = () if found is None else found.unlisted(self._screen.loop.name)
        return (*self._rivals.shapes(model), *together), unlisted

    def taken_together(self, model: AxisModel) -> tuple[str, ...]:
        """Several effects of a complete model that one curve beside the others does better than.

        Of a wave over position and other effects a curve over something else only has to predict as
        well: in strokes of equal length, what goes with velocity comes back at equal distances.
        Most effects, if there are several such sets; of as many, those that lose most.
        """
        whole = self._screen.model(model) if len(model.terms) > 1 else None
        waves, hidden = pitches(model), self.hidden(model) if whole is not None else ()
        shown = [t.name for t in model.terms if t.effect.group in _FORCES or t.name not in hidden]
        for size in range(len(shown), 1, -1):
            taken: tuple[float, tuple[str, ...]] = -math.inf, ()
            for names in combinations(shown, size):
                linear = self._screen.linear(_without(model, names))
                curves = fit_curves(self._screen, COORDINATES, linear) if linear is not None else []
                if whole is None or not curves:
                    continue
                best = curves[0]
                excess, error = compare(whole, best.prediction)
                is_better = excess > self._rivals.margin(error) and size < len(model.terms)
                is_wave = best.coordinate.along != "position" and not waves.keys().isdisjoint(names)
                is_enough = self._screen.closed(best.prediction) >= ENOUGH
                is_alike = is_enough and not self._is_better(whole, best.prediction)
                if is_better or (is_wave and is_alike):
                    taken = max(taken, (excess, names))
            if taken[1]:
                return taken[1]
        return ()

    def _misfits(self, model: AxisModel) -> list[str]:
        """Effects that close no more than the shape of another one of their group may lack.

        None where all effects together predict clearly better than a curve alone.
        """
        best, whole = self._rivals.best, self._screen.model(model)
        if best is None or whole is None or len(model.terms) < 2:
            return []
        excess, error = compare(whole, best.prediction)
        if excess < -CLEARLY * error:
            return []
        margin = self._rivals.margin(error)
        shown = [loss > margin for loss in losses(self._screen, model, whole)]
        terms = list(zip(model.terms, shown, strict=True))
        groups = {term.effect.group for term, shows in terms if shows}
        return [t.name for t, shows in terms if not shows and t.effect.group in groups]

    def beat(self, before: AxisModel, after: AxisModel) -> bool:
        """Whether a curve beside a model is the answer, and not the effect that was added to it.

        Args:
            before: the model.
            after: with the effect.
        """
        found, whole = self.curves(before), self._screen.model(after)
        best = None if found is None else found.best
        if best is None or whole is None or self._screen.closed(best.prediction) < ENOUGH:
            return False
        return self._is_better(best.prediction, whole)

    def complement(self, model: AxisModel) -> Curve | None:
        """The curve that explains together with a model what neither explains alone.

        Both predict other moves better than any curve alone, and not by chance.
        """
        found = self.curves(model) if self._rivals.curves else None
        best = None if found is None else found.best
        if found is None or best is None:
            return None
        is_better = self._is_better(best.prediction, self._rivals.curves[0].prediction)
        return best if is_better else None

    def keep(self, model: AxisModel, curve: Curve) -> bool:
        """Whether a model beside a curve keeps its names against a second curve there."""
        alone, linear = self._screen.curve(curve.coordinate), self._screen.linear(model)
        whole = None if linear is None else self._screen.curve(curve.coordinate, linear)
        if alone is None or whole is None:
            return False
        if alone.prediction.energy <= NEAR * self._screen.floor:
            return True  # it leaves nothing along the motion
        second = fit_curves(self._screen, COORDINATES, self._screen.as_linear(curve))
        excess, error = compare(whole.prediction, second[0].prediction)
        return excess <= Rivals(self._screen, second, alone.prediction).margin(error)

    def hidden(self, model: AxisModel) -> tuple[str, ...]:
        """Effects of a model that do not show along the motion, as mass and dead time."""
        whole = self._screen.model(model)
        lost = [] if whole is None else losses(self._screen, model, whole)
        least = FAINT * self._screen.floor
        pairs = zip(model.names(), lost, strict=False)
        return tuple(name for name, loss in pairs if loss <= least)

    def curves(self, model: AxisModel) -> Rivals | None:
        """The curves beside a model; None where it cannot be simulated, or leaves little."""
        linear = self._screen.linear(model)
        alone = None if linear is None else self._screen.predict(linear)
        if alone is None:
            return None
        if alone.energy <= NEAR * self._screen.floor and not self._is_clearly_better(alone):
            return None
        return Rivals(self._screen, fit_curves(self._screen, COORDINATES, linear), alone)

    def _is_clearly_better(self, prediction: Prediction) -> bool:
        """Whether the best curve predicts clearly better than something else."""
        if self._rivals.best is None:
            return False
        excess, error = compare(prediction, self._rivals.best.prediction)
        return excess > CLEARLY * error

    def _is_better(self, one: Prediction, other: Prediction) -> bool:
        """Whether one predicts other moves better, by what matters and not by chance."""
        gained = other.energies - one.energies
        return gained.sum() > FAINT * self._screen.floor and is_certain(gained[gained != 0.0])


def _without(model: AxisModel, names: Sequence[str]) -> AxisModel:
    """A model without effects."""
    return replace(model, terms=tuple(term for term in model.terms if term.name not in names))
