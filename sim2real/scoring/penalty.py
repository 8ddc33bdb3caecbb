"""What a set of effects costs, whatever it is fitted to.

Source: docs/decisions/0017-one-gate-one-score.md.
"""

from __future__ import annotations

from hil_sim.settings import AxisSettings
from sim2real.fitting import AxisModel, implausibility
from sim2real.scoring.constants import EACH, IMPLAUSIBLE, TRANSMISSION


def effects_penalty(model: AxisModel, axis: AxisSettings) -> float:
    """Score that a model's effects have to save: for their number, their kind and their values.

    In units of twice the negative log likelihood. Of two explanations that fit equally well the
    simpler and more plausible one wins.

    Args:
        model: the model.
        axis: of the machine file.
    """
    return sum(
        EACH * len(term.values)
        + TRANSMISSION * (term.effect.transmission and not term.effect.any_size)
        + IMPLAUSIBLE * implausibility(term, axis)
        for term in model.terms
    )
