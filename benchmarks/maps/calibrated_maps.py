"""Error of a map between the sites, from whole calibrations of simulated tables.

Like `friction_map.py`, but only the tables are drawn: each calibration is a run over the CAN bus at
25 sites over 100 x 100 mm, of a stage whose Coulomb force varies by +-25 % (40 mm) and wanders by
1 %, and the map is built from the estimates of its moves.

A map's errors are correlated over some 40 mm, so one map has little more than a dozen independent
ones: even of exact posteriors (kernel, length, amplitude and noise known), only two of three have
90 to 99 % of the truths inside the 95 % band, and one of seven has less (`friction_map.py
--observer`).

    python -m benchmarks.maps.calibrated_maps [--tables 20] [--first 1]
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.maps.shift import calibrate
from benchmarks.shared.machine_facts import machine_facts


def main() -> None:
    """Two maps, of x and y, of each table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--tables", type=int, default=20)
    parser.add_argument("--first", type=int, default=1, help="seed of the first one")
    options = parser.parse_args()
    print(machine_facts())
    found = []
    for seed in range(options.first, options.first + options.tables):
        with tempfile.TemporaryDirectory() as folder:
            maps = calibrate(str(Path(folder) / "stage.db"), seed)
        found += maps.values()
        print(
            seed, *(f"{axis}: {error:.2%}, {inside:.1%}" for axis, (error, inside) in maps.items())
        )
    errors, inside = np.array(found).T
    print(
        f"{len(found)} maps: error {np.sqrt(np.mean(errors**2)):.2%} rms, worst map "
        f"{errors.max():.2%} (must be <= 4 %); {inside.mean():.1%} of the truths inside the 95 % "
        f"band (must be 90...99 %), in single maps {inside.min():.1%} to {inside.max():.1%}: "
        f"{np.mean(inside < 0.9):.0%} of them below 90 %, {np.mean(inside > 0.99):.0%} above 99 %"
    )


if __name__ == "__main__":
    main()
