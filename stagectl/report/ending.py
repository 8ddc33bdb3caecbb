"""How a run ended, in words: where, why, how to continue, and whether the wafer is good.

For the report's head and for the terminal, from the summary alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

Summary = Mapping[str, Any]


def interruption(summary: Summary) -> str | None:
    """Where a run ended early: "at site 8 of 20"; None where it is complete."""
    stop = summary.get("interrupted")
    if stop is None:
        return None
    unit, done, of = stop["unit"], stop["done"], stop["of"]
    if stop["at"] is not None:
        return f"at {unit} {stop['at']} of {of}"
    return f"after {unit} {done} of {of}" if done else f"before the first of {of} {unit}s"


def reason(summary: Summary) -> str:
    """Why a run ended early, or ""."""
    return str(summary.get("interrupted", {}).get("reason") or summary["fault"] or "")


def resume_command(summary: Summary) -> str | None:
    """The command line that continues the run, or None."""
    command = summary.get("interrupted", {}).get("resume")
    return None if command is None else str(command)


def verdict(summary: Summary) -> str | None:
    """The verdict on the wafer by the recipe's limits; None where it has none."""
    limits = summary.get("limits")
    if limits is None:
        return None
    wafer = f"wafer {summary['wafer']}" if summary.get("wafer") else "wafer"
    passed, failed, of = limits["passed"], limits["failed"], limits["of"]
    if limits["verdict"] == "fail":
        return f"{wafer} fails: {failed} of {passed + failed} sites miss the limits"
    if limits["verdict"] == "pass":
        return f"{wafer} passes: all {of} sites are within the limits"
    within = ", all within the limits" if passed else ""
    return f"{wafer} incomplete: {passed} of {of} sites judged{within}"
