"""Pass or fail per site by the recipe's `limits`, judged on the site's micro-move.

A site without micro-move (no fiducial) is judged on its macro-move.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from stagectl.recipe import SiteLimits
from stagectl.sequencer.settling import MoveResult, summarise_moves
from stagedata import Recording


@dataclass(frozen=True, slots=True)
class SiteVerdict:
    """One site; `failures` names what exceeded its limit, and is empty for a pass."""

    site: int
    failures: tuple[str, ...]


def judge(
    recording: Recording,
    limits: SiteLimits,
    window: float,
    control_period: float,
    sync_period: float,
) -> tuple[SiteVerdict, ...]:
    """Verdicts of all sites in the order of their visit; none where the recipe has no limits.

    A site that was repeated after a fault is judged on its last visit.

    Args:
        recording: of the run.
        limits: longest settling [s] to `window` and largest peak error [m].
        window: the recipe's settle window [m].
        control_period: Tc [s].
        sync_period: Ts [s].
    """
    if limits.settling is None and limits.peak_error is None:
        return ()
    results = summarise_moves(recording, control_period, sync_period, (window,))
    visits = {}
    for number, move in enumerate(recording.moves):
        if move.site is not None and (move.kind == "macro" or move.site not in visits):
            visits[move.site] = number
    sites: dict[int, list[MoveResult]] = {site: [] for site in visits}
    for result in results:
        if result.site is not None and result.move >= visits[result.site]:
            sites[result.site].append(result)
    return tuple(SiteVerdict(site, _failures(of, limits, window)) for site, of in sites.items())


def _failures(results: Sequence[MoveResult], limits: SiteLimits, window: float) -> tuple[str, ...]:
    judged = [r for r in results if r.kind == "micro"] or results
    failures = []
    for result in judged:
        time, error = result.settling[window], result.peak_error
        if limits.settling is not None and not (result.settled and time <= limits.settling):
            failures.append(
                f"{result.axis} settled in {time * 1e3:.0f} ms, limit {limits.settling * 1e3:g} ms"
                if result.settled
                else f"{result.axis} did not settle"
            )
        if limits.peak_error is not None and (math.isnan(error) or error > limits.peak_error):
            failures.append(
                f"{result.axis} peak error {error * 1e6:.3f} µm, "
                f"limit {limits.peak_error * 1e6:g} µm"
            )
    return tuple(failures)
