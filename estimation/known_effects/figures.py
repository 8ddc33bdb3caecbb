"""Friction figures with what is known of them beyond the machine file's."""

from __future__ import annotations

from dataclasses import replace

from estimation.known_effects.terms import KnownTerms
from stagedata import FrictionFigures


def known_figures(terms: KnownTerms, friction: FrictionFigures) -> FrictionFigures:
    """The figures with known ratios; C/Fc stays, and what the law does not have stays 0."""
    alpha = friction.static_ratio if terms.static_ratio is None else terms.static_ratio
    return replace(
        friction,
        coulomb=friction.coulomb * terms.coulomb,
        viscous=friction.viscous * terms.viscous,
        stiffness=friction.stiffness * terms.stiffness,
        static_ratio=alpha,
    )
