"""The outcome of a trial as a line of JSON."""

from __future__ import annotations

import json
import math
from dataclasses import replace

from sim2real.blind import Outcome
from tests.unit.sim2real.blind.outcomes import outcome


def test_an_outcome_comes_back_from_its_line():
    made = outcome(
        "one", "x cogging", "x cogging 0.9", "explained", sigmas={"x.cogging.force": 1.5},
        confusable=(("x", ("cogging", "force_ripple")),), promised=0.9,
    )  # fmt: skip
    line = json.dumps({"label": "v", **made.to_json()}, allow_nan=False)
    assert Outcome.from_json(json.loads(line)) == made
    unknown = replace(made, sigmas={"x.cogging.force": math.nan})
    back = Outcome.from_json(json.loads(json.dumps(unknown.to_json(), allow_nan=False)))
    assert math.isnan(back.sigmas["x.cogging.force"])
