"""How close the estimator's spread comes to the Cramer-Rao bound, and how honest its sigma is.

The N = 4 model on its own data at 1 kHz, no wander: 25 mm out of rest and settling, encoder noise
1 nm rms, force exact or in steps of 0.04 N. The bound is computed here from a dense covariance and
finite differences, apart from the estimator's own normal equations.

    python benchmarks/monte_carlo.py [--runs 1000]
"""

from __future__ import annotations

import argparse

import numpy as np
from machine_facts import machine_facts
from numpy.typing import NDArray

from estimation.belief import BeliefSettings
from estimation.gms import Friction, FrictionState, follow
from estimation.noise import quantisation
from estimation.split_horizon import EstimatorSettings, MoveData, SplitHorizonEstimator
from estimation.trajectory import Limits, plan
from estimation.zones import REST, split

F64 = NDArray[np.float64]
TS, MASS, ENCODER = 1e-3, 8.0, 1e-9
TRUE = Friction(4, 6.0, 20.0, 6e5, 100.0, 0.4, 2e-3, 1.0)
NAMES = ("coulomb", "viscous", "stiffness", "mass")


def positions() -> F64:
    """The move, sampled; at rest at both ends."""
    motion = plan(0.0, 25e-3, Limits(0.5, 3.0, 200.0))
    return motion.sample(np.arange(-3, int(motion.duration / TS) + 50) * TS)[0]


def force(position: F64, figures: F64) -> F64:
    """What the model predicts at the inner samples, for (Fc, sigma_v, sigma0, mass)."""
    model = Friction(4, figures[0], figures[1], figures[2], 100.0, 0.4, 2e-3, 1.0)
    velocity = (position[2:] - position[:-2]) / (2 * TS)
    acceleration = (position[2:] - 2 * position[1:-1] + position[:-2]) / TS**2
    state = FrictionState.relaxed(4, float(position[0]))
    elements, _ = follow(model, state, position[1:-1], velocity, TS)
    result: F64 = elements + figures[1] * velocity + figures[3] * acceleration
    return result


def bound(position: F64, force_noise: float) -> F64:
    """Cramer-Rao standard deviations of the four figures."""
    truth = np.array([TRUE.coulomb, TRUE.viscous, TRUE.stiffness, MASS])
    moving = np.flatnonzero(split(position, TRUE, TS) != REST)
    jacobian = np.column_stack(
        [
            (force(position, truth + step) - force(position, truth - step))[moving]
            / (2 * step.max())
            for step in np.diag(1e-5 * truth)
        ]
    )
    count = len(moving)
    difference = np.zeros((count, count + 2))
    for i in range(count):
        difference[i, i : i + 3] = [1.0, -2.0, 1.0]
    covariance = (MASS * ENCODER / TS**2) ** 2 * difference @ difference.T
    covariance += force_noise**2 * np.eye(count)
    whitened = np.linalg.solve(np.linalg.cholesky(covariance), jacobian)
    return np.sqrt(np.diag(np.linalg.inv(whitened.T @ whitened)))


def run(runs: int, step: float) -> None:
    """Print spread over bound, bias over bound and coverage for one force resolution."""
    clean = positions()
    truth = np.array([TRUE.coulomb, TRUE.viscous, TRUE.stiffness, MASS])
    exact = force(clean, truth)
    exact = np.concatenate([[0.0], exact, [exact[-1]]])
    noise = quantisation(step) if step else 1e-9
    settings = EstimatorSettings(
        MASS, TS, ENCODER, noise, model_error=0.0, belief=BeliefSettings(wander=0.0),
        fixed=("relaxation_rate",),
    )  # fmt: skip
    rng = np.random.default_rng(1)
    found, inside = np.empty((runs, 4)), np.empty((runs, 4), dtype=bool)
    for i in range(runs):
        measured = clean + rng.normal(0.0, ENCODER, len(clean))
        # A fresh phase of the rounding in each run, as on a stage at other forces.
        phase = rng.uniform(0.0, step) if step else 0.0
        seen = np.round((exact + phase) / step) * step - phase if step else exact
        estimator = SplitHorizonEstimator(TRUE.scaled(0.5), settings)
        estimator.at_rest(0.0, 0.0, -1.0)
        rest = MoveData(np.zeros(5), np.zeros(5), np.ones(5, dtype=bool), -1.0, 0.0)
        estimator.update(rest)  # the state before the move is known
        estimate = estimator.update(
            MoveData(measured, seen, np.ones(len(clean), dtype=bool), 1.0, 0.0)
        )
        if not estimate.accepted:
            found[i] = np.nan
            continue
        model, sigma = estimate.friction, estimate.sigma
        found[i] = (model.coulomb, model.viscous, model.stiffness, estimate.mass[0])
        spread = np.array(
            [sigma["coulomb"], sigma["viscous"], sigma["stiffness"], estimate.mass[1]]
        )
        inside[i] = np.abs(found[i] - truth) < 1.96 * spread
    kept = np.isfinite(found[:, 0])
    found, inside = found[kept], inside[kept]
    limits = bound(clean, noise)
    print(f"| force {'in steps of ' + format(step, 'g') + ' N' if step else 'exact'} | spread/bound"
          " | bias/bound | inside 95 % |")  # fmt: skip
    print("| --- | --- | --- | --- |")
    for name, values, value, limit, hits in zip(
        NAMES, found.T, truth, limits, inside.T, strict=True
    ):
        print(
            f"| {name} | {values.std() / limit:.2f} | {(values.mean() - value) / limit:+.2f} "
            f"| {hits.mean():.1%} |"
        )
    print(f"\n{runs - int(kept.sum())} of {runs} moves refused by the estimator\n")


def main() -> None:
    """Both force resolutions."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=1000)
    runs = parser.parse_args().runs
    print(f"{runs} runs; {machine_facts()}\n")
    for step in (0.0, 0.04):
        run(runs, step)


if __name__ == "__main__":
    main()
