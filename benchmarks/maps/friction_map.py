"""Error and coverage of a map between the sites, over many random tables.

25 calibrated sites over 100 x 100 mm, Coulomb force within +-25 %, correlation length 40 mm. There
are six kinds of fields, only the first of which the map's kernels assume: Gaussian processes
(Gaussian, Matern 5/2), waves with a band of lengths, bumps, a ramp with a ridge, and a quadratic
with a smoothed step. Sites: a grid, a grid with jitter, or random. Each site's estimate has an
error of its own (`--noise`, known to the map as its sigma).

    python -m benchmarks.maps.friction_map [--tables 60] [--seed 1] [--noise 0.01]

A map's errors are correlated over some 40 mm, so its coverage scatters from map to map even if
nothing is wrong with it. An ideal observer who knows kernel, length, amplitude and noise shows by
how much, on the same tables:

    python -m benchmarks.maps.friction_map --observer [--tables 150]
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from benchmarks.shared.machine_facts import machine_facts
from estimation.field import FrictionField, Node

F64 = NDArray[np.float64]
Function = Callable[[F64], F64]
SIDE, LENGTH, SWING = 0.1, 0.04, 0.25
NOMINAL = 6.0


def waves(generator: np.random.Generator, spectrum: F64, count: int) -> Function:
    """Random Fourier features with these wave numbers [rad/m]."""
    angle = generator.uniform(0, 2 * np.pi, count)
    k = spectrum[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    phase = generator.uniform(0, 2 * np.pi, count)
    return lambda p: np.cos(p @ k.T + phase).sum(axis=1)


def gaussian(generator: np.random.Generator) -> Function:
    """Correlation exp(-r^2 / (2 l^2))."""
    return waves(generator, np.hypot(*generator.normal(0, 1 / LENGTH, (2, 300))), 300)


def matern(generator: np.random.Generator) -> Function:
    """Matern 5/2 with length 40 mm: its spectrum is a Student t of 5 degrees of freedom."""
    scale = np.sqrt(5.0 / generator.chisquare(5, 300))
    return waves(generator, np.hypot(*generator.normal(0, 1 / LENGTH, (2, 300))) * scale, 300)


def band(generator: np.random.Generator) -> Function:
    """Four plane waves; the length over which their correlation falls to exp(-1/2) is 40 mm."""
    return waves(generator, np.sqrt(2.0) / LENGTH * generator.uniform(0.7, 1.2, 4), 4)


def bumps(generator: np.random.Generator) -> Function:
    """Worn and greasy spots of 40 mm."""
    centres = generator.uniform(-0.02, SIDE + 0.02, (7, 2))
    height = generator.normal(0, 1, 7)

    def field(p: F64) -> F64:
        r = np.linalg.norm(p[:, None] - centres[None], axis=2)
        total: F64 = (height * np.exp(-0.5 * (r / LENGTH) ** 2)).sum(axis=1)
        return total

    return field


def ridge(generator: np.random.Generator) -> Function:
    """A ramp over the table, with a band along which the guide is worn."""
    angle, offset = generator.uniform(0, np.pi, 2), generator.uniform(0, SIDE)
    slope = generator.normal(0, 1)

    def field(p: F64) -> F64:
        u = p @ np.array([np.cos(angle[0]), np.sin(angle[0])])
        w = p @ np.array([np.cos(angle[1]), np.sin(angle[1])])
        total: F64 = slope * u / SIDE + np.exp(-0.5 * ((w - offset) / LENGTH) ** 2)
        return total

    return field


def bowl(generator: np.random.Generator) -> Function:
    """Thicker lubricant to the rim, and a transition 40 mm wide."""
    centre, angle = generator.uniform(0, SIDE, 2), generator.uniform(0, 2 * np.pi)

    def field(p: F64) -> F64:
        d = p - centre
        u = d @ np.array([np.cos(angle), np.sin(angle)])
        total: F64 = (d**2).sum(axis=1) / SIDE**2 + 0.5 * np.tanh(u / LENGTH)
        return total

    return field


FIELDS = {f.__name__: f for f in (gaussian, matern, band, bumps, ridge, bowl)}


def table(
    make: Callable[[np.random.Generator], Function], generator: np.random.Generator
) -> Function:
    """Coulomb force [N] over places [m]: the field centred, its extremes at +-25 %."""
    raw = make(generator)
    grid = np.stack(np.meshgrid(*[np.linspace(0, SIDE, 41)] * 2), -1).reshape(-1, 2)
    values = raw(grid)
    middle, half = (values.max() + values.min()) / 2, (values.max() - values.min()) / 2
    return lambda p: NOMINAL * (1.0 + SWING * (raw(p) - middle) / half)


def sites(kind: str, generator: np.random.Generator) -> F64:
    """25 places [m], shape (25, 2)."""
    if kind == "anywhere":
        return generator.uniform(0, SIDE, (25, 2))
    step = (np.arange(5) + 0.5) * SIDE / 5 if kind == "jittered" else np.linspace(0, SIDE, 5)
    places: F64 = np.stack(np.meshgrid(step, step), -1).reshape(-1, 2)
    return places + (generator.uniform(-0.008, 0.008, places.shape) if kind == "jittered" else 0)


def beside_the_observer(count: int, seed: int, noise: float) -> None:
    """Maps and the observer's, Gaussian fields, sites on a grid: error, honesty of each map."""
    rms = SWING / np.sqrt(3.0)  # of levels spread evenly over +-SWING
    known = [Node(1.0, "gaussian", LENGTH, float(rms), 0.0)]
    found: dict[str, list[tuple[float, float, float]]] = {"map": [], "observer": []}
    for number in range(count):
        generator = np.random.default_rng([seed, number])
        raw = gaussian(generator)
        places, unseen = sites("grid", generator), generator.uniform(0, SIDE, (500, 2))
        measured, true = (rms * np.sqrt(2.0 / 300) * raw(p) for p in (places, unseen))
        values = np.exp(measured + noise * generator.standard_normal(25))
        for name, nodes in (("map", None), ("observer", known)):
            predicted = FrictionField(places, values, np.full(25, noise), nodes=nodes).at(unseen)
            error = np.log(predicted.value) - true
            z = error / predicted.sigma
            found[name].append((np.mean(error**2), np.mean(z**2), np.mean(np.abs(z) < 1.96)))
    print("           error rms  error/sigma rms  in 95 % band  maps < 90 %  90...99 %  > 99 %")
    for name, rows in found.items():
        error, z, held = np.array(rows).T
        inside = np.mean((held >= 0.9) & (held <= 0.99))
        print(
            f"{name:<10} {np.sqrt(error.mean()):9.2%} {np.sqrt(z.mean()):16.2f} {held.mean():13.1%}"
            f"{np.mean(held < 0.9):12.0%} {inside:10.0%} {np.mean(held > 0.99):7.0%}"
        )


def main() -> None:
    """Error rms and share of truths inside the 95 % band, by kind of field and of sites."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--tables", type=int, default=60, help="of each kind")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--noise", type=float, default=0.01, help="relative error of an estimate")
    parser.add_argument("--observer", action="store_true", help="maps beside an ideal observer")
    options = parser.parse_args()
    print(machine_facts())
    if options.observer:
        beside_the_observer(options.tables, options.seed, options.noise)
        return
    print(f"{options.tables} tables each, estimates off by {options.noise:.1%} rms")
    print(
        "sites     field     error rms  worst table  in 95 % band  tables 90...99 %  outside  fit"
    )
    for arrangement in ("grid", "jittered", "anywhere"):
        for name, make in FIELDS.items():
            generator = np.random.default_rng([options.seed, len(name), len(arrangement)])
            errors, held, spent, beyond = [], [], 0.0, []
            for _ in range(options.tables):
                truth = table(make, generator)
                places = sites(arrangement, generator)
                measured = truth(places) * (1 + options.noise * generator.standard_normal(25))
                begin = time.perf_counter()
                field = FrictionField(places, measured, np.full(25, options.noise))
                spent += time.perf_counter() - begin
                unseen = generator.uniform(0, SIDE, (200, 2))
                predicted = field.at(unseen)
                low, high = predicted.band()
                true = truth(unseen)
                errors.append(predicted.value / true - 1)
                held.append(((true >= low) & (true <= high)).mean())
                beyond.append(1 - predicted.inside.mean())
            by_table = np.sqrt(np.mean(np.square(errors), axis=1))
            print(
                f"{arrangement:<9} {name:<9} {np.sqrt(np.mean(np.square(errors))):8.2%} "
                f"{by_table.max():11.2%} {np.mean(held):12.1%} "
                f"{np.mean([0.9 <= share <= 0.99 for share in held]):15.0%} {np.mean(beyond):9.1%} "
                f"{spent / options.tables * 1e3:5.0f} ms"
            )


if __name__ == "__main__":
    main()
