"""Tracking of sites from move to move: how soon a step is flagged, and how many false alarms.

20 sites in turn, 0.35 s apart; the Coulomb level wanders by 1 % rms with 0.5 s correlation time, a
move shows it to 0.4 %, the map is off by 1 %, and after each hour's pause the stage warms up by 30
% with 120 s.

    python -m benchmarks.maps.tracking [--moves 30000] [--steps 100] [--wander 0.01]
"""

from __future__ import annotations

import argparse
import math
from collections import Counter

import numpy as np

from benchmarks.shared.machine_facts import machine_facts
from estimation.field import SiteTracker, TrackingSettings
from estimation.field.change import false_alarm_rate

SITES, EVERY, MAP, SHOWN = 20, 0.35, 0.01, 0.004


def shift(seed: int, wafers: int, wander: float, size: float = 0.0) -> tuple[int | None, int]:
    """Visits until the step in the middle was flagged, and other alarms."""
    generator = np.random.default_rng(seed)
    off = generator.normal(0.0, MAP, SITES)
    tracker = SiteTracker(np.zeros(SITES), MAP**2 * np.eye(SITES), TrackingSettings())
    time = cold = level = 0.0
    found: int | None = None
    others = 0
    for wafer in range(wafers):
        if wafer and wafer % 25 == 0:
            time += 3600.0
            cold = time
        for site in range(SITES):
            time += EVERY
            keep = math.exp(-EVERY / 0.5)
            level = keep * level + math.sqrt(1 - keep**2) * generator.normal(0.0, wander)
            true = off[site] + math.log1p(0.3 * math.exp(-(time - cold) / 120.0))
            after = wafer - wafers // 2
            if site == 7 and after >= 0:
                true += math.log1p(size)
            shown = true + level + generator.normal(0.0, SHOWN)
            if tracker.observe(site, shown, SHOWN, time).step:
                if size and site == 7 and after >= 0 and found is None:
                    found = after + 1
                else:
                    others += 1
        time += 2.0
    return found, others


def main() -> None:
    """False alarms of quiet moves, then steps of several sizes."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--moves", type=int, default=30_000)
    parser.add_argument("--steps", type=int, default=100, help="of each size")
    parser.add_argument("--wander", type=float, default=0.01, help="the tracker assumes 0.01")
    options = parser.parse_args()
    print(machine_facts())
    wafers = 100
    shifts = max(1, options.moves // (SITES * wafers))
    alarms = sum(shift(seed, wafers, options.wander)[1] for seed in range(shifts))
    print(
        f"{shifts * SITES * wafers} quiet moves: {alarms} false alarms (must be <= 5 in 10,000; "
        f"for normal surprises {false_alarm_rate():.1e} a move)"
    )
    for size in (0.2, -0.2, 0.1, 0.05, -0.05):
        runs = [shift(1000 + seed, 20, options.wander, size) for seed in range(options.steps)]
        visits = Counter("never" if found is None else found for found, _ in runs)
        seen = ", ".join(f"{n} after {v}" for v, n in sorted(visits.items(), key=str))
        print(f"step of {size:+.0%}: {seen} move(s) there; other alarms {sum(o for _, o in runs)}")


if __name__ == "__main__":
    main()
