"""Spread of the estimates over the Cramer-Rao bound, and coverage of the stated sigma.

The N = 4 model on its own data at 1 kHz, no wander: about 25 mm from rest to settling, encoder
noise 1 nm rms, force in steps of 0.04 N, through `SplitHorizonEstimator.update`, started at half
of all figures. Every run draws true figures (10 %), length and direction of the move, and the
phase of the samples. Errors are in units of that run's bound: the spread over the bound is their
standard deviation.

The bound is computed here, from finite differences of the model and a dense covariance: encoder
noise through the second difference, viscous friction and every sticking element, first position
included; rounding as white noise. Unknown besides the four figures: the force at rest before the
move, measured there once; the force after the stop (samples do not show how long the elements still
slip within the last one) and its sample.

A planned profile is smooth to a fraction of an encoder increment, a real motion is not: --jitter
adds a motion of this rms [m] to every sample faster than 5 mm/s, which the force follows.
--force-noise replaces the steps by white noise of this rms [N]. --velocity: s-curves no faster
than this, at lower acceleration and jerk, so that most of the motion is at one speed. --elements:
another N. --wide: true figures off by -40 to +60 % of what the host halves.

    python -m benchmarks.estimation.monte_carlo [--runs 1000] [--stage reference|paper] [--jobs 1]
                                     [--jitter 1e-9] [--force-noise 6e-4] [--velocity 0.1]
                                     [--elements 8] [--wide]
"""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from benchmarks.shared.machine_facts import machine_facts
from estimation.friction import FrictionState, follow
from estimation.move import MoveData
from estimation.noise import quantisation
from estimation.online import BeliefSettings, EstimatorSettings, SplitHorizonEstimator
from estimation.trajectory import Limits, plan
from stagedata import FrictionFigures

F64 = NDArray[np.float64]
TS, ENCODER, REST, FASTEST = 1e-3, 1e-9, 5, 0.5
STEP = 0.04
"""Resolution of the force [N]."""
JITTERS = 5e-3
"""A motion slower than that does not jitter: it would turn back [m/s]."""
NAMES = ("coulomb", "viscous", "stiffness", "mass")
STAGES = {
    "reference": (8.0, FrictionFigures(4, 6.0, 20.0, 6e5, 100.0, 0.4, 2e-3, 1.0)),
    "paper": (1.0, FrictionFigures(4, 2.0, 1.0, 1e3, 2.0, 0.5, 1e-3, 1.0)),
}


@dataclass(frozen=True, slots=True)
class Case:
    """Some runs.

    Attributes:
        stage, profile: of `STAGES`; sine or s-curve.
        noise: white noise of the force instead of steps, 0: steps of `STEP` [N].
        jitter: of the true motion [m].
        velocity: most of an s-curve [m/s].
        elements: N.
        wide: whether true figures are off by -40 to +60 % instead of 10 %.
        first, runs: numbers of the runs.
    """

    stage: str
    profile: str
    noise: float = 0.0
    jitter: float = 0.0
    velocity: float = FASTEST
    elements: int = 4
    wide: bool = False
    first: int = 0
    runs: int = 0


def sine(length: float, time: F64) -> F64:
    """Sine acceleration of 3 m/s^2 peak: positions at `time` [s]."""
    total = np.sqrt(2.0 * np.pi * length / 3.0)
    t = np.clip(time, 0.0, total)
    w = 2.0 * np.pi / total
    result: F64 = length / total * (t - np.sin(w * t) / w)
    return result


def positions(profile: str, length: float, phase: float, velocity: float) -> F64:
    """A move from rest to rest, sampled; `phase` of a sample period into the first one."""
    time = (np.arange(-REST, 320) + phase) * TS
    if profile == "sine":
        return sine(length, time)
    if velocity >= FASTEST:
        return plan(0.0, length, Limits(velocity, 3.0, 200.0)).sample(time)[0]
    # On the reference stage, viscous friction takes the force a code on with each sample there.
    motion = plan(0.0, length, Limits(velocity, 2.0, 130.0))
    return motion.sample((np.arange(-REST, motion.duration / TS + 80) + phase) * TS)[0]


def force(position: F64, model: FrictionFigures, mass: float, before: float = 0.0) -> F64:
    """What the model says at every inner sample; the ends repeat their neighbours.

    `before`: sum of the element forces at rest before the move [N], shared evenly.
    """
    velocity = (position[2:] - position[:-2]) / (2 * TS)
    acceleration = (position[2:] - 2 * position[1:-1] + position[:-2]) / TS**2
    state = FrictionState.relaxed(model.elements, float(position[0]))
    state.forces += before / model.elements
    elements, _ = follow(model, state, position[1:-1], velocity, TS, band=0.0)
    inner = elements + model.viscous * velocity + mass * acceleration
    return np.concatenate([inner[:1], inner, inner[-1:]])


def model_at(model: FrictionFigures, figures: F64) -> FrictionFigures:
    """The model with the first three of the figures."""
    return replace(model, coulomb=figures[0], viscous=figures[1], stiffness=figures[2])


def bound(position: F64, model: FrictionFigures, mass: float, force_noise: float) -> F64:
    """Cramer-Rao standard deviations of the four figures."""
    truth = np.array([model.coulomb, model.viscous, model.stiffness, mass])
    count = len(position)

    def predicted(figures: F64, x: F64) -> F64:
        return force(x, model_at(model, figures), figures[3])[1:-1]

    jacobian = np.column_stack(
        [
            (predicted(truth + d, position) - predicted(truth - d, position)) / (2 * d.max())
            for d in np.diag(1e-5 * truth)
        ]
    )
    # What one position's error does: by finite differences too, but not behind the stop, where the
    # direction of a nanometre means nothing; there it is a spring.
    last = int(np.flatnonzero(np.abs(np.diff(position)) > 20e-9)[-1]) + 1
    by_position = np.zeros((count - 2, count))
    for k in range(last + 1):
        d = np.zeros(count)
        d[k] = 2e-11
        by_position[:, k] = (
            predicted(truth, position + d) - predicted(truth, position - d)
        ) / 4e-11
    for k in range(last + 1, count):
        for row, share in ((k - 2, 1.0), (k - 1, -2.0), (k, 1.0)):
            if row < count - 2:
                by_position[row, k] = share * mass / TS**2
        if k <= count - 2:
            by_position[k - 1, k] += model.stiffness
    covariance = ENCODER**2 * by_position @ by_position.T + force_noise**2 * np.eye(count - 2)
    stop = np.zeros((count - 2, 2))
    stop[last - 1 :, 0] = 1.0
    stop[last - 2, 1] = 1.0
    by_rest = (force(position, model, mass, 1e-6) - force(position, model, mass, -1e-6)) / 2e-6
    # All in units of what they come to, so that the equations stay well conditioned.
    whitened = np.linalg.solve(
        np.linalg.cholesky(covariance),
        np.column_stack([jacobian * truth, 1e-2 * stop, force_noise * by_rest[1:-1]]),
    )
    whitened = np.vstack([whitened, np.eye(7)[6:]])  # the force at rest was measured once
    whitened = np.linalg.qr(whitened, mode="r")
    spread: F64 = truth * np.linalg.norm(np.linalg.inv(whitened)[:4], axis=1)
    return spread


def one(case: Case, number: int) -> tuple[F64, F64] | None:
    """Errors over the bound and over the reported sigma; None where the move was refused."""
    rng = np.random.default_rng([number, case.stage == "paper", case.profile == "sine"])
    mass, nominal = STAGES[case.stage]
    nominal = replace(nominal, elements=case.elements)
    truth = np.array([nominal.coulomb, nominal.viscous, nominal.stiffness, mass])
    truth *= rng.uniform(0.6, 1.6, 4) if case.wide else rng.uniform(0.9, 1.1, 4)
    truth[3] = mass * rng.uniform(0.98, 1.02)
    model = model_at(nominal, truth)
    sign = rng.choice([-1.0, 1.0])
    length = 25e-3 * rng.uniform(0.9, 1.1)
    clean = sign * positions(case.profile, length, rng.uniform(), case.velocity)
    if case.jitter:
        moving = np.abs(np.gradient(clean)) / TS > JITTERS
        clean += moving * np.random.default_rng([number, 1]).normal(0.0, case.jitter, len(clean))
    exact = force(clean, model, truth[3])
    noise, phase = case.noise or quantisation(STEP), rng.uniform(0.0, STEP)
    if case.noise:
        seen = exact + np.random.default_rng([number, 2]).normal(0.0, case.noise, len(exact))
    else:
        seen = np.round((exact + phase) / STEP) * STEP - phase
    measured = clean + rng.normal(0.0, ENCODER, len(clean))
    settings = EstimatorSettings(
        mass, TS, ENCODER, noise, model_error=0.0, belief=BeliefSettings(wander=0.0),
        fixed=("relaxation_rate",),
    )  # fmt: skip
    estimator = SplitHorizonEstimator(
        nominal.scaled(0.5), settings, state=FrictionState.relaxed(nominal.elements)
    )
    estimate = estimator.update(
        MoveData(
            measured, seen, np.ones(len(clean), dtype=bool), 1.0, float(seen[: REST - 1].mean())
        )
    )
    if not estimate.accepted:
        return None
    found, sigma = estimate.friction, estimate.sigma
    error = np.array([found.coulomb, found.viscous, found.stiffness, estimate.mass[0]]) - truth
    spread = np.array([*(sigma[name] for name in NAMES[:3]), estimate.mass[1]])
    return error / bound(clean, model, truth[3], noise), error / spread


def some(case: Case) -> list[tuple[F64, F64] | None]:
    """The runs of a case, in order."""
    return [one(case, number) for number in range(case.first, case.first + case.runs)]


def table(case: Case, jobs: int) -> None:
    """Print the table of a case."""
    runs = case.runs
    ends = [runs * j // jobs for j in range(jobs + 1)]
    parts = [replace(case, first=a, runs=b - a) for a, b in pairwise(ends)]
    if jobs == 1:
        results = some(case)
    else:
        with ProcessPoolExecutor(jobs) as pool:
            results = [result for part in pool.map(some, parts) for result in part]
    kept = [result for result in results if result is not None]
    errors, scores = np.array([e for e, _ in kept]), np.array([s for _, s in kept])
    force = f"with {case.noise:g} N of noise" if case.noise else f"in steps of {STEP:g} N"
    force += f", jitter {case.jitter:g} m" if case.jitter else ""
    force += f", {case.velocity:g} m/s" if case.velocity < FASTEST else ""
    force += f", N = {case.elements}" if case.elements != 4 else ""
    force += ", truths -40 to +60 %" if case.wide else ""
    print(f"| {case.stage} stage, {case.profile}, force {force} | spread/bound | bias/bound "
          "| inside 95 % |\n| --- | --- | --- | --- |")  # fmt: skip
    for name, error, score in zip(NAMES, errors.T, scores.T, strict=True):
        print(
            f"| {name} | {error.std():.2f} | {error.mean():+.2f} "
            f"| {np.mean(np.abs(score) < 1.96):.1%} |"
        )
    print(f"\n{runs - len(kept)} of {runs} moves refused\n", flush=True)


def main() -> None:
    """All tables."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--runs", type=int, default=1000)
    parser.add_argument("--stage", choices=list(STAGES), help="one of them [both]")
    parser.add_argument("--jitter", type=float, default=0.0, help="of the true motion [m] [0]")
    parser.add_argument(
        "--force-noise", type=float, default=0.0, help="white, instead of steps [N] [0]"
    )
    parser.add_argument("--velocity", type=float, default=FASTEST, help="of s-curves [m/s] [0.5]")
    parser.add_argument("--elements", type=int, default=4, help="N [4]")
    parser.add_argument("--wide", action="store_true", help="truths off by -40 to +60 %%")
    parser.add_argument("--jobs", type=int, default=1)
    given = parser.parse_args()
    print(f"{given.runs} runs each; {machine_facts()}\n")
    for stage in [given.stage] if given.stage else list(STAGES):
        for profile in ("s-curve",) if given.velocity < FASTEST else ("sine", "s-curve"):
            case = Case(
                stage, profile, given.force_noise, given.jitter, given.velocity, given.elements,
                given.wide, 0, given.runs,
            )  # fmt: skip
            table(case, given.jobs)


if __name__ == "__main__":
    main()
