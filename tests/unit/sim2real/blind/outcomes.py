"""Outcomes of trials, constructed from words."""

from __future__ import annotations

from dataclasses import replace

from sim2real.blind import Outcome
from sim2real.blind.draw import Drawn
from sim2real.blind.outcome import ReportedCause

OVER = {"quadratic_drag": "velocity", "cogging_harmonics": "position"}


def outcome(kind, truth, reported, verdict, **more):
    """Effects as "x cogging", reported as "x cogging 0.9", several parted by commas."""
    causes = []
    for text in filter(None, reported.split(", ")):
        axis, name, probability = text.split()
        causes.append(ReportedCause(axis, name, float(probability), 0.9, {"force": (1.0, 0.1)}))
    effects = []
    for text in filter(None, truth.split(", ")):
        axis, name = text.split()
        kin = "" if kind == "outside" else name.removesuffix("_harmonics")
        effects.append(Drawn(axis, name, {"force": 1.1}, 4.0, kin, OVER.get(name, "")))
    plain = Outcome(
        1, 0, False, kind, tuple(effects), verdict, tuple(causes), (), {}, 4.0, None, None, 10.0,
        9.0, "{}", "", "",
    )  # fmt: skip
    return replace(plain, **more)  # type: ignore[arg-type]
