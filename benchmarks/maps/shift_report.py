"""Results of a shift of production, from one line per wafer and mode."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path
from statistics import mean, median
from typing import Any

import numpy as np

from benchmarks.maps.shift_table import SPOT


def done(folder: Path, mode: str) -> int:
    """Number of wafers that a mode has completed; a line cut off by a kill is removed."""
    path = folder / f"{mode}.jsonl"
    if not path.exists():
        return 0
    text = path.read_text()
    whole = text[: text.rfind("\n") + 1]
    if whole != text:
        path.write_text(whole)
    return len(whole.splitlines())


def report(modes: Sequence[str], wafers: int, folder: Path, spot: float) -> None:
    """Print the table and the steps that were flagged."""
    common = min(done(folder, mode) for mode in modes)
    if common == 0:
        print("no wafer is through in all modes")
        return
    rows = {
        mode: [
            json.loads(line)
            for line in (folder / f"{mode}.jsonl").read_text().splitlines()[:common]
        ]
        for mode in modes
    }
    killed = folder / "killed"
    print(
        f"{common} of {wafers} wafers; the map's host was begun anew behind "
        f"{', '.join(str(n) for n in (wafers // 4, wafers // 2) if n < common) or 'none'}, killed "
        f"{killed.read_text().strip() if killed.exists() else 'nowhere yet'}"
    )
    print(
        f"{'micro-moves: settling, ms':<28}  ±50 nm median (mean)  within 5 ms  ±200 nm  peak, um  "
        "moves"
    )
    for mode, lines in rows.items():
        micro = [m for line in lines for m in line["micro"]]
        fine = [m["50"] * 1e3 for m in micro]
        print(
            f"{mode:<28}  {median(fine):8.1f} ({mean(fine):5.1f})   "
            f"{mean(t <= 5.0 for t in fine):10.1%}  "
            f"{median(m['200'] for m in micro) * 1e3:8.1f}  "
            f"{median(m['peak'] for m in micro) * 1e6:6.3f}  {len(micro)}"
        )
    if "map" in rows and "oracle" in rows:
        beside_the_oracle(rows["map"], rows["oracle"])
    if "map" in rows:
        flagged = [(line["wafer"], *step) for line in rows["map"] for step in line["steps"]]
        there = [f for f in flagged if f[1] == "x" and math.dist(f[2:4], SPOT) < 1e-3]
        true = [f for f in there if f[0] >= wafers // 2]
        visits = "never" if not true else f"after {true[0][0] - wafers // 2 + 1} move(s) there"
        moves = sum(len(line["micro"]) for line in rows["map"])
        others = [f for f in flagged if f not in true[:1]]
        print(f"spot of {spot:.0%}: flagged {visits}")
        print(f"other flags: {len(others)} in {moves} moves: {others[:8]}")


def beside_the_oracle(lines: Sequence[Any], oracle: Sequence[Any]) -> None:
    """Print ratios to the oracle with confidence intervals, and a move-by-move comparison.

    About half of all moves are in the window as soon as the demand arrives or shortly after, so few
    settling times lie near the median, and one move in a hundred shifts it by a millisecond or two.
    A finer clock would not help. Hence 95 % bootstrap intervals over wafers, the mean, the upper
    quartile, and a comparison of each move with the oracle's.
    """
    theirs = [{(m["axis"], m["site"]): m["50"] for m in line["micro"]} for line in oracle]
    pairs = [
        np.array([(m["50"], own[m["axis"], m["site"]]) for m in line["micro"]]) * 1e3
        for line, own in zip(lines, theirs, strict=True)
    ]
    generator = np.random.default_rng(0)
    drawn = [
        np.concatenate([pairs[i] for i in generator.integers(0, len(pairs), len(pairs))])
        for _ in range(1000)
    ]
    whole = np.concatenate(pairs)
    (a, c), (b, d), (e, f) = np.median(whole, 0), whole.mean(0), np.quantile(whole, 0.75, axis=0)
    shown = f"{a:.1f} over {c:.1f} ms" if c == 0 else f"{a / c:.2f}"
    away = np.percentile([np.subtract(*np.median(s, 0)) for s in drawn], [2.5, 97.5])
    ratio = np.percentile([np.divide(*s.mean(0)) for s in drawn], [2.5, 97.5])
    slower, faster = (np.mean(sign * (whole[:, 0] - whole[:, 1]) > 1.0) for sign in (1, -1))
    print(
        f"map over oracle: median {shown} (must be <= 1.25; {away[0]:+.1f} to {away[1]:+.1f} ms "
        f"between them), mean {b / d:.2f} ({ratio[0]:.2f} to {ratio[1]:.2f}), upper quartile "
        f"{e / f:.2f}"
    )
    print(
        f"move by move: later than the oracle's by more than 1 ms {slower:.0%}, sooner {faster:.0%}"
    )
