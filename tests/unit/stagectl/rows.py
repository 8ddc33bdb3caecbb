"""Rows of a history, as runs file them."""

from itertools import count

from stagectl.history import EstimateRecord, RunEntry, StageKey

STAGE = StageKey("wafer-xy", True)
BEGIN = 1.7e9
_wafer = count(1)


def run_entry(stage=STAGE, started=BEGIN, **other):
    values = {
        "axes": ("x", "y"), "recipe": "r", "lot": "L1", "wafer": f"W{next(_wafer)}",
        "software": "stagectl 0", "folder": "runs/x",
    }  # fmt: skip
    return RunEntry(stage, started=started, **{**values, **other})


def estimate_record(run, **other):
    values = {
        "axis": "x", "kind": "macro", "site": 1, "place": (0.01, -0.02), "time": BEGIN + 1.0,
        "distance": 0.025, "accepted": True, "reason": None,
        "figures": {"coulomb": 6.0, "viscous": 20.0}, "covariance": (0.04, 0.01, 0.01, 0.25),
    }  # fmt: skip
    return EstimateRecord(run, **{**values, **other})
