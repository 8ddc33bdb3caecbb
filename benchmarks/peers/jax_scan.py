"""JAX: the model as `lax.scan`, its derivatives by `jacfwd`, Levenberg-Marquardt, all in one `jit`.

Steps leave the box only as far as its bounds (projected).
"""

from __future__ import annotations

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from benchmarks.peers.problem import F64, START, ZONE_A, ZONE_AB, Problem

jax.config.update("jax_enable_x64", True)
ITERATIONS = 20
TOLERANCE = 1e-8


def make(problem: Problem, damping: float) -> Callable[[], F64]:
    """A complete two-zone estimate; `damping` 0 is Gauss-Newton, else where LM begins."""

    @jax.jit
    def both(p: jax.Array) -> jax.Array:
        for free in (ZONE_A, ZONE_AB):
            p = _minimise(_residual(problem, free), p, jnp.array(free), problem, damping)
        return p

    start = jnp.ones(4)

    def solve() -> F64:
        return np.asarray(both(start).block_until_ready())

    return solve


def _residual(problem: Problem, free: tuple[int, ...]) -> Callable[[jax.Array], jax.Array]:
    steps, rows = problem.steps, problem.rows(free)
    used = int(steps.last[rows.stop - 1]) + 1
    data = tuple(jnp.asarray(column) for column in steps.table(used))
    count = START.elements
    shares = 2.0 * jnp.arange(1, count + 1) / (count * (count + 1))
    last = jnp.asarray(steps.last[rows])
    factor = problem.factor(rows.stop - rows.start)
    dense = np.diag(factor[:, 2]) + np.diag(factor[1:, 1], -1) + np.diag(factor[2:, 0], -2)
    whitening = jnp.asarray(np.linalg.inv(dense))
    velocity, acceleration = (
        jnp.asarray(a[rows]) for a in (problem.velocity, problem.acceleration)
    )
    force = jnp.asarray(problem.force[1:-1][rows])
    chosen, spread = jnp.array(free), jnp.asarray(problem.spread)

    def elements(coulomb: jax.Array, stiffness: jax.Array) -> jax.Array:
        def step(state, row):  # type: ignore[no-untyped-def]
            f, slips = state
            dx, direction, curve, before, decay, reset = row
            slips = slips & (reset == 0.0)
            goal = direction * shares * curve * coulomb
            stretched = f + stiffness / count * dx
            begins = ~slips & (stretched * direction >= jnp.abs(goal))
            limit = shares * before * coulomb
            room = limit - f * direction
            closing = (stretched - f) * direction - (jnp.abs(goal) - limit)
            lands = begins & (room > 0.0) & (closing > 0.0)
            at = jnp.minimum(room / jnp.where(lands, closing, 1.0), 1.0)
            rest = 1.0 - (1.0 - at) * (1.0 - decay)
            landed = goal + (f + at * (stretched - f) - goal) * rest
            slips = slips | begins
            slid = jnp.where(lands, landed, goal + (f - goal) * decay)
            f = jnp.where(slips, slid, stretched)
            return (f, slips), f.sum()

        rest = (jnp.zeros(count), jnp.zeros(count, dtype=bool))
        return lax.scan(step, rest, data)[1]

    def residual(p: jax.Array) -> jax.Array:
        figures = p * problem.scale
        total = elements(figures[0], figures[2])[last]
        total = jnp.where(last >= 0, total, 0.0)
        plain = total + figures[1] * velocity + figures[3] * acceleration - force
        return jnp.concatenate([whitening @ plain, (p[chosen] - 1.0) / spread[chosen]])

    return residual


def _minimise(residual, p, free, problem, damping):  # type: ignore[no-untyped-def]
    """Levenberg-Marquardt over p[free]; a step is kept where it does not raise the cost."""
    derivative = jax.jacfwd(lambda q, p: residual(p.at[free].set(q)))

    def go_on(state):  # type: ignore[no-untyped-def]
        _, _, _, moved, i = state
        return (moved > TOLERANCE) & (i < ITERATIONS)

    def iterate(state):  # type: ignore[no-untyped-def]
        p, cost, mu, _, i = state
        jacobian, r = derivative(p[free], p), residual(p)
        normal = jacobian.T @ jacobian
        normal = normal + mu * jnp.diag(jnp.diag(normal))
        q = jnp.clip(
            p[free] - jnp.linalg.solve(normal, jacobian.T @ r), problem.lower, problem.upper
        )
        trial = p.at[free].set(q)
        trial_cost = jnp.sum(residual(trial) ** 2)
        better = trial_cost <= cost
        moved = jnp.max(jnp.abs(trial - p))
        mu = jnp.where(better, mu * 0.1, jnp.maximum(mu, 1e-4) * 10.0)
        return jnp.where(better, trial, p), jnp.where(better, trial_cost, cost), mu, moved, i + 1

    begin = (p, jnp.sum(residual(p) ** 2), jnp.asarray(damping), jnp.inf, 0)
    return lax.while_loop(go_on, iterate, begin)[0]
