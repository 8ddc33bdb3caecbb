"""The probability that an effect is present, by the scores of all sets of effects fitted.

One model of probability for both objectives, tracked innovations and the free loop.

Source: docs/decisions/0017-one-gate-one-score.md.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from sim2real.scoring.constants import ALIKE, CHOSEN


def weigh_effect(
    scores: Mapping[tuple[str, ...], float], chosen: Sequence[str], effect: str
) -> tuple[float, list[str]]:
    """Probability that an effect of the chosen set is present, and what could take its place.

    Sets count by their scores, as posterior odds. The chosen set is the best or the simplest, so
    its effects count for half at least.

    Args:
        scores: names of a set, sorted -> twice its negative log likelihood, penalties included.
        chosen: names of the set that was chosen, in any order.
        effect: one of these.

    Returns:
        The probability, and names of the effects that could take its place.
    """
    own, least = set(chosen), min(scores.values())
    odds = {names: math.exp(0.5 * (least - value)) for names, value in scores.items()}
    present = sum(weight for names, weight in odds.items() if effect in names)
    enough = ALIKE * odds.get(tuple(sorted(own)), 1.0)
    others = [
        other
        for names, weight in sorted(odds.items(), key=lambda item: -item[1])
        if weight > enough and own - set(names) == {effect}
        for other in set(names) - own
        if len(names) == len(own)
    ]
    return max(present / sum(odds.values()), CHOSEN), others
