"""The outcome of a trial as a line of JSON."""

from __future__ import annotations

import json
import math
from dataclasses import replace

from sim2real.blind import (
    Drawn,
    Outcome,
    ReportedCause,
)


def outcome(kind: str, truth: str, told: str, verdict: str, **more: object) -> Outcome:
    """Effects as "x cogging", told as "x cogging 0.9", several parted by commas."""
    causes = []
    for text in filter(None, told.split(", ")):
        axis, name, probability = text.split()
        causes.append(ReportedCause(axis, name, float(probability), 0.9, {"force": (1.0, 0.1)}))
    effects = []
    for text in filter(None, truth.split(", ")):
        axis, name = text.split()
        kin = "" if kind == "outside" else name.removesuffix("_harmonics")
        effects.append(Drawn(axis, name, {"force": 1.1}, 4.0, kin))
    plain = Outcome(
        1, 0, False, kind, tuple(effects), verdict, tuple(causes), (), {}, 4.0, None, None, 10.0,
        9.0, "{}", "", "",
    )  # fmt: skip
    return replace(plain, **more)  # type: ignore[arg-type]


def test_an_outcome_comes_back_from_its_line() -> None:
    made = outcome(
        "one", "x cogging", "x cogging 0.9", "explained", sigmas={"x.cogging.force": 1.5},
        confusable=(("x", ("cogging", "force_ripple")),), promised=0.9,
    )  # fmt: skip
    line = json.dumps({"label": "v", **made.to_json()}, allow_nan=False)
    assert Outcome.from_json(json.loads(line)) == made
    unknown = replace(made, sigmas={"x.cogging.force": math.nan})
    back = Outcome.from_json(json.loads(json.dumps(unknown.to_json(), allow_nan=False)))
    assert math.isnan(back.sigmas["x.cogging.force"])
