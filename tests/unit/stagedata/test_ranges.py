"""Ranges in the annotations of settings are checked; the message names setting, range and value."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Literal

import pytest
from annotated_types import Gt, Interval, Le

from stagedata.ranges import Count, NotNegative, Positive, check_ranges


@dataclass(frozen=True)
class Settings:
    mass: Positive = 1.0
    noise: NotNegative = 0.0
    node: Annotated[int, Interval(ge=1, le=127)] = 1
    share: Annotated[float, Gt(0), Le(1)] = 1.0
    at_most: Count | None = None
    span: Literal[1, 2] = 1
    name: str = ""

    def __post_init__(self):
        check_ranges(self)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"mass": 0.0}, "mass: must be > 0, is 0"),
        ({"mass": math.inf}, "mass: must be > 0, is inf"),
        ({"mass": math.nan}, "mass: must be > 0, is nan"),
        ({"noise": -1e-12}, "noise: must be >= 0, is -1e-12"),
        ({"noise": math.nan}, "noise: must be >= 0, is nan"),
        ({"node": 128}, "node: must be 1..127, is 128"),
        ({"share": 1.5}, "share: must be <= 1, is 1.5"),
        ({"at_most": 0}, "at_most: must be >= 1, is 0"),
        ({"span": 3}, "span: must be one of 1, 2, is 3"),
    ],
)
def test_a_value_outside_its_range_is_refused_by_name(change, text):
    with pytest.raises(ValueError, match=f"^{text.replace('.', '[.]')}$"):
        Settings(**change)


def test_values_at_the_ends_and_none_are_accepted():
    Settings(mass=5e-324, noise=0.0, node=127, share=1.0, at_most=None, span=2)
