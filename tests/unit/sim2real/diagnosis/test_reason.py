"""The words of a reason."""

from __future__ import annotations

import pytest

from sim2real.diagnosis.reason import name_causes
from sim2real.findings import Cause


@pytest.mark.parametrize(
    ("effects", "words"),
    [
        ("c", "cogging on x"),
        ("cd", "cogging on x and dead_time on y"),
        ("cdc", "cogging on x, dead_time on y and cogging on x"),
    ],
)
def test_the_last_cause_is_joined_by_and(effects, words):
    known = {"c": ("x", "cogging"), "d": ("y", "dead_time")}
    assert name_causes([Cause(*known[e], 1.0, {}, None, None, "") for e in effects]) == words
