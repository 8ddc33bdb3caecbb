"""What changes over time, and what stages with an effect have in common.

Both ask many questions at once, so an answer counts only where chance alone would give one of that
kind in the whole fleet with a probability of `CHANCE` (Bonferroni).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stagectl.fleet.stages import Series, StageState
from stagedata import F64

CHANCE = 0.01
DAY = 86_400.0
FEWEST_DAYS = 8
"""With fewer even a strict order is no evidence among many series."""
_FEWEST_STAGES = 3
"""Of both kinds, with the effect and without it."""


@dataclass(frozen=True, slots=True, eq=False)
class Drift:
    """A figure that rises or falls.

    Attributes:
        series: that it is of.
        per_day: slope, in the figure's unit per day (Theil and Sen).
        interval: 95 % interval of it.
        start: value of that line at the first day.
        days: from the first to the last.
        chance: probability of such an order of days by chance (Kendall), times the series asked.
    """

    series: Series
    per_day: float
    interval: tuple[float, float]
    start: float
    days: float
    chance: float

    @property
    def change(self) -> float:
        """Relative, over all days."""
        return self.per_day * self.days / self.start


@dataclass(frozen=True, slots=True)
class Common:
    """What stages with an effect have in common.

    Attributes:
        effect: its name.
        keys: in machine file or run, whose values separate the stages alike.
        values: of these keys.
        of_those: stages with the effect that have the values, and all with the effect.
        of_others: stages without the effect that have the values, and all without it.
        chance: probability of such a share by chance (Fisher), times the questions asked.
    """

    effect: str
    keys: tuple[str, ...]
    values: tuple[str, ...]
    of_those: tuple[int, int]
    of_others: tuple[int, int]
    chance: float


def find_drifts(series: Sequence[Series]) -> list[Drift]:
    """Figures that change over time, the largest relative change first.

    The median of each day counts: recordings of one day share what is peculiar to the day.
    """
    from scipy.stats import kendalltau, theilslopes

    daily = [(each, *_daily(each)) for each in series]
    asked = [(each, day, value) for each, day, value in daily if len(day) >= FEWEST_DAYS]
    found = []
    for each, day, value in asked:
        chance = float(kendalltau(day, value).pvalue) * len(asked)
        if not chance < CHANCE:  # nan where all values are alike
            continue
        slope, middle, low, high = map(float, theilslopes(value, day, 0.95))
        start = middle + slope * float(day[0])
        if start > 0.0 and low * high > 0.0:
            days = float(day[-1] - day[0])
            found.append(Drift(each, slope, (low, high), start, days, chance))
    return sorted(found, key=lambda drift: -abs(drift.change))


def _daily(series: Series) -> tuple[F64, F64]:
    """Days with values, and the median of each."""
    number = np.floor(series.time / DAY)
    days = np.unique(number)
    return days, np.array([np.median(series.value[number == day]) for day in days])


def find_common(stages: Sequence[StageState]) -> list[Common]:
    """What stages with an effect have in common that others lack, the least accidental first."""
    from scipy.stats import fisher_exact

    having: dict[str, set[int]] = defaultdict(set)
    groups: dict[frozenset[int], dict[str, str]] = defaultdict(dict)
    shared: dict[tuple[str, str], set[int]] = defaultdict(set)
    for number, stage in enumerate(stages):
        for shown in stage.effects:
            having[shown.effect].add(number)
        for item in stage.attributes.items():
            shared[item].add(number)
    for (key, value), alike in shared.items():
        if _FEWEST_STAGES <= len(alike) < len(stages):
            groups[frozenset(alike)][key] = value
    effects = {
        effect: who for effect, who in having.items()
        if _FEWEST_STAGES <= len(who) <= len(stages) - _FEWEST_STAGES
    }  # fmt: skip
    found = []
    for effect, ill in effects.items():
        for who, attributes in groups.items():
            inside, outside = len(ill & who), len(who - ill)
            healthy = len(stages) - len(ill)
            table = [[inside, len(ill) - inside], [outside, healthy - outside]]
            chance = float(fisher_exact(table, "greater").pvalue) * len(effects) * len(groups)
            if chance < CHANCE:
                found.append(
                    Common(
                        effect, tuple(attributes), tuple(attributes.values()), (inside, len(ill)),
                        (outside, healthy), chance,
                    )
                )  # fmt: skip
    return sorted(found, key=lambda common: common.chance)
