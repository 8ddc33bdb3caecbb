"""Facts of a run for the report's header, in words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

Summary = Mapping[str, Any]


def friction_map_used(summary: Summary) -> str:
    """Which friction map the run went by, in words."""
    if summary.get("map") is None:
        if summary["compensation"] != "estimated":
            return f"none (compensation {summary['compensation']})"
        return "none"
    comment = summary.get("map_comment")
    return f"map {summary['map']}" + (f" ({comment})" if comment else "")


def learned_feedforward(summary: Summary) -> str:
    """What each axis has learned to feed forward; empty in a run that could not learn it."""
    axes = []
    for axis, learned in summary.get("feedforward", {}).items():
        shown = (
            f"mass {100.0 * learned['mass']:+.1f}\u00a0%" if learned["mass"] else "",
            f"lead {1e3 * learned['lead']:+.2f}\u00a0ms" if learned["lead"] else "",
            f"coupling {100.0 * learned['coupling']:+.1f}\u00a0%" if learned["coupling"] else "",
        )
        axes.append(f"{axis}: {', '.join(filter(None, shown)) or 'as in the machine file'}")
    return "; ".join(axes)
