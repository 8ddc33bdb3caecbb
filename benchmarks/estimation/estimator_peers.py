"""The estimator compared with general solvers on the same problem, and with a plain C loop.

One move, 250 samples, four unknowns, two zones (`peers/problem.py`). Complete estimates are timed
in turn in one run, so that load on the machine affects all of them. All answers are put into the
same cost function: `excess` is the cost above the lowest found (chi-square), `apart` the distance
from our answer (largest of the four, in our standard deviations; ours also estimates the force at
rest, so it need not be 0).

    python -m benchmarks.estimation.estimator_peers [--rounds 7] [--json OUT]

Needs nothing beyond the project's own dependencies; peers that are not installed are listed
(`pip install jax casadi do-mpc`), and without gcc the C loop is left out.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import importlib.util
import json
import os
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from benchmarks.peers.problem import F64, NAMES, UNITS, Problem, build, differences
from benchmarks.shared.machine_facts import machine_facts
from estimation.friction import FrictionState, follow
from estimation.move import MoveData
from estimation.noise import quantisation
from estimation.online import EstimatorSettings, SplitHorizonEstimator
from estimation.trajectory import Limits, plan
from stagedata import FrictionFigures

BUDGET = 0.5
"""Seconds that a peer may take in one round."""
SAME = 0.01
"""A peer's excess below it is the same minimum; ours is if no figure is APART from it."""
APART = 1.0
OWN = "SplitHorizonEstimator.update"
# What is demanded: limit on our own time over the peer's; seconds; seconds; ratio.
LEAST_RATIO = {"scipy": 6.0, "jax": 6.0, "ipopt": 200.0}
MOST_SECONDS, MOST_SECONDS_ALL, MOST_C_RATIO = 60e-6, 1e-3, 2.0


@dataclass
class Peer:
    """A solver of the problem, and the time it took.

    Attributes:
        key: family, of `LEAST_RATIO` or another.
        name: as printed.
        module: of `peers` that makes it, and what that module needs installed.
        arguments: of its `make`, behind the problem.
    """

    key: str
    name: str
    module: str
    needs: str
    arguments: tuple[object, ...] = ()
    times: list[float] = field(default_factory=list)
    first: float = 0.0
    answer: F64 | None = None


PEERS = (
    Peer("scipy", "scipy leastsq (MINPACK), differences", "minpack", "scipy", ("differences",)),
    Peer("scipy", "scipy leastsq (MINPACK), derivatives", "minpack", "scipy", ("derivatives",)),
    Peer("scipy", "scipy least_squares, method lm", "minpack", "scipy", ("least_squares",)),
    Peer("jax", "JAX scan, jacfwd, Gauss-Newton", "jax_scan", "jax", (0.0,)),
    Peer("jax", "JAX scan, jacfwd, Levenberg-Marquardt", "jax_scan", "jax", (1e-3,)),
    Peer("ipopt", "CasADi, IPOPT", "casadi_nlp", "casadi", ("ipopt",)),
    Peer("qpoases", "CasADi, SQP with qpOASES", "casadi_nlp", "casadi", ("qpoases",)),
    Peer("do-mpc", "do-mpc MHE (IPOPT)", "dompc_mhe", "do_mpc"),
)


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Nothing on standard output, not from compiled libraries either (qpOASES greets)."""
    sys.stdout.flush()
    kept = os.dup(1)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nowhere)


def measure(
    problem: Problem, rounds: int
) -> tuple[list[Peer], list[str], list[float], tuple[F64, F64]]:
    """Time all in turn: the peers, the missing ones, our times, our answer with its sigma."""
    peers, missing, solvers = [], [], []
    for peer in PEERS:
        if importlib.util.find_spec(peer.needs) is None:
            missing.append(
                f"{peer.name}: not installed (pip install {peer.needs.replace('_', '-')})"
            )
            continue
        with quiet():
            begin = time.perf_counter()
            make: Callable[..., Callable[[], F64]] = importlib.import_module(
                f"benchmarks.peers.{peer.module}"
            ).make
            solver = make(problem, *peer.arguments)
            peer.answer = solver()
            peer.first = time.perf_counter() - begin
        peers.append(peer)
        solvers.append(solver)
    _, answer = _own(problem, 3)  # compiled and warm
    own: list[float] = []
    for _ in range(rounds):
        times, answer = _own(problem, 200)
        own += times
        for peer, solver in zip(peers, solvers, strict=True):
            end = time.perf_counter() + BUDGET
            with quiet():
                while True:
                    begin = time.perf_counter()
                    peer.answer = solver()
                    peer.times.append(time.perf_counter() - begin)
                    if time.perf_counter() > end:
                        break
    return peers, missing, own, answer


def _own(problem: Problem, count: int) -> tuple[list[float], tuple[F64, F64]]:
    """Complete estimates through the public interface, each by an estimator of its own."""
    times, estimate = [], None
    for _ in range(count):
        estimator, move = problem.ready()
        begin = time.perf_counter()
        estimate = estimator.update(move)
        times.append(time.perf_counter() - begin)
    assert estimate is not None
    assert estimate.accepted, estimate.reason
    return times, problem.relative(estimate)


def all_figures(rounds: int) -> tuple[list[float], str]:
    """Times of estimates with nothing fixed: N = 8, 400 samples, wandering level."""
    true = FrictionFigures(8, 6.0, 20.0, 6e5, 100.0, 0.4, 2e-3, 1.0)
    motion, ts = plan(0.0, 25e-3, Limits(0.3, 1.0, 50.0)), 1e-3
    clean = motion.sample(np.arange(-3, 397) * ts)[0]
    rng = np.random.default_rng(1)
    position = clean + rng.normal(0.0, 1e-9, 400)
    velocity, acceleration = differences(clean)
    elements, _ = follow(true, FrictionState.relaxed(8), clean[1:-1], velocity, ts)
    inner = elements + true.viscous * velocity + 8.0 * acceleration
    force = np.round(np.concatenate([[0.0], inner, inner[-1:]]) / 0.04) * 0.04
    valid = np.ones(400, dtype=np.bool_)
    settings = EstimatorSettings(8.0, ts, 1e-9, quantisation(0.04))
    times, said = [], ""
    for _ in range(50 * rounds):
        estimator = SplitHorizonEstimator(true.scaled(0.5), settings)
        estimator.at_rest(0.0, 0.0, -1.0)
        estimator.update(MoveData(np.zeros(5), np.zeros(5), np.ones(5, dtype=bool), -1.0, 0.0))
        move = MoveData(position, force, valid, 0.0, 0.0)
        begin = time.perf_counter()
        estimate = estimator.update(move)
        times.append(time.perf_counter() - begin)
        said = f"zones {estimate.zones}, {'accepted' if estimate.accepted else estimate.reason}"
    return times[5:], said


def c_loop(problem: Problem, rounds: int) -> dict[str, float] | str:
    """Times of single evaluations, or why there are none."""
    try:
        from benchmarks.peers import c_loop as loop

        return loop.ratio(problem, 20 * rounds)
    except (OSError, ImportError) as error:
        return str(error)


def report(rounds: int) -> dict[str, object]:
    """Measure, print the tables, and return all of it."""
    problem = build()
    peers, missing, own_times, (own_answer, sigma) = measure(problem, rounds)
    own = float(np.median(own_times))
    answers = [own_answer, *(p.answer for p in peers if p.answer is not None)]
    lowest = min(problem.cost(a) for a in answers)
    print(f"{machine_facts()}; {rounds} rounds; medians\n")
    head = " | ".join(f"{n}, {u}" for n, u in zip(NAMES, UNITS, strict=True))
    print(f"| complete estimate | ms | p99, ms | times ours | must | excess | apart | {head} |")
    print("|" + " --- |" * 11)
    rows: list[dict[str, object]] = []
    listed = [("own", OWN, own_times, own_answer, 0.0)]
    listed += [(p.key, p.name, p.times, p.answer, p.first) for p in peers if p.answer is not None]
    for key, name, times, answer, first in listed:
        median, late = float(np.median(times)), float(np.quantile(times, 0.99))
        excess = problem.cost(answer) - lowest
        least = LEAST_RATIO.get(key)
        figures = " | ".join(f"{x:.6g}" for x in answer * problem.scale)
        must = (
            f"<= {MOST_SECONDS * 1e3:g} ms" if key == "own" else (f">= {least:g}" if least else "")
        )
        apart = float((np.abs(answer - own_answer) / sigma).max())
        same = apart < APART and (key == "own" or excess < SAME)
        where = f"{excess:.1e} | {apart:.2f}{'' if same else ' **other minimum**'}"
        print(f"| {name} | {median * 1e3:.3f} | {late * 1e3:.3f} | {median / own:.1f} | {must} "
              f"| {where} | {figures} |")  # fmt: skip
        rows.append(
            {
                "name": name, "family": key, "median": median, "p99": late, "first": first,
                "ratio": median / own, "must_ratio": least, "excess": excess,
                "apart": apart,
                "same_minimum": same,
                "answer": dict(zip(NAMES, (answer * problem.scale).tolist(), strict=True)),
            }
        )  # fmt: skip
    print("\nThe first call, imports and compilation included, is not in the medians: " + ", ".join(
        f"{p.name} {p.first:.1f} s" for p in peers))  # fmt: skip
    for line in missing:
        print(line)
    everything, said = all_figures(rounds)
    spent = float(np.median(everything))
    print(f"\nAll figures, N = 8, 400 samples: {spent * 1e3:.3f} ms ({said}); must <= 1 ms")
    loop = c_loop(problem, rounds)
    if isinstance(loop, str):
        print(f"C loop: {loop}")
    else:
        print(
            f"One residual-and-sensitivity evaluation: {loop['own'] * 1e6:.2f} us, "
            f"C loop (gcc -O3 -march=native) {loop['c'] * 1e6:.2f} us, "
            f"ratio {loop['own'] / loop['c']:.2f}; must <= {MOST_C_RATIO:g} "
            f"(chi-squares {loop['chi_own']:.6g}, {loop['chi_c']:.6g})"
        )
    misses = _misses(rows, own, spent, loop)
    print("\n" + ("All musts are met." if not misses else "Not met: " + "; ".join(misses)))
    return {
        "machine": machine_facts(), "rounds": rounds, "samples": len(problem.position),
        "median": own, "peers": rows[1:], "own": rows[0], "missing": missing,
        "all_figures": {"median": spent, "said": said},
        "c_loop": loop if isinstance(loop, dict) else {"missing": loop}, "not_met": misses,
    }  # fmt: skip


def _misses(
    rows: list[dict[str, object]], own: float, spent: float, loop: dict[str, float] | str
) -> list[str]:
    """What was demanded and is not reached; a family is judged by its fastest member."""
    found = []
    if own > MOST_SECONDS:
        found.append(f"estimate {own * 1e6:.0f} us > {MOST_SECONDS * 1e6:g} us")
    for key, least in LEAST_RATIO.items():
        ratios = [float(str(r["ratio"])) for r in rows if r["family"] == key]
        if ratios and min(ratios) < least:
            found.append(f"{key} {min(ratios):.0f} times < {least:g}")
    if spent > MOST_SECONDS_ALL:
        found.append(f"all figures {spent * 1e3:.2f} ms > 1 ms")
    if isinstance(loop, dict) and loop["own"] > MOST_C_RATIO * loop["c"]:
        found.append(f"C loop ratio {loop['own'] / loop['c']:.2f} > {MOST_C_RATIO:g}")
    return found


def main() -> None:
    """Parse, measure, print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--json", type=Path, metavar="OUT", help="write the figures here too")
    arguments = parser.parse_args()
    found = report(max(arguments.rounds, 1))
    if arguments.json is not None:
        arguments.json.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
