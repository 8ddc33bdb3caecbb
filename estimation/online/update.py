"""From the samples of a move to a verdict, compiled.

The samples are cleaned and their zones found (`prepare`), the belief aged (`arrival_cost`), the
force at rest taken as the friction force there, zone A and then all that is usable solved
(`solve`); `judge` decides what is believed, and the friction state is carried to the move's end.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation.compiled import kernel
from estimation.friction.law import F64, correct
from estimation.online.arrival_cost import age, knots_of, wander_on
from estimation.online.belief import ALPHA, COULOMB, KNOTS, LEVEL
from estimation.online.judge import (
    find_jump,
    hold_undetermined,
    judge,
    noise_excess,
    sliding_level,
    temper,
)
from estimation.online.outcome import ACCEPTED, FEW, Outcome
from estimation.online.prepare import prepare
from estimation.online.residual import AtRest, follow_move
from estimation.online.settings import CALM, SHORT, USUAL
from estimation.online.solve import FAILED, SOLVED, Solution, solve


class State(NamedTuple):
    """What is known between moves, for the kernels; changed in place.

    Attributes:
        mean: belief, shape (LEVEL + 1,).
        covariance: of it.
        forces: internal forces of the friction law at rest [N], shape (n,).
        slips: which of them slide, shape (n,).
        memory: direction of motion, and position up to which it was taken [m].
    """

    mean: F64
    covariance: F64
    forces: F64
    slips: NDArray[np.bool_]
    memory: F64


@kernel()
def update_move(sampled, axis, law, state, elapsed, restless, known, whole):  # type: ignore[no-untyped-def]
    """Learn from a move, and carry the friction state to its end (61 lines: the order of it all).

    Args:
        sampled: the move.
        axis: settings.
        law: constants of the friction law.
        state: after the last move; updated, of a move that is not over only the friction state.
        elapsed: since the end of the last move [s]; negative: there was none.
        restless: variance by which Coulomb force ages beside its drift, relative.
        known: False where only the sum of the internal forces is known; so it is where neither the
            position at rest nor the first sample is.
        whole: False for a look at a move that is not over: zone A only.

    A move with fewer than three valid samples changes nothing; its verdict is FEW.
    """
    size = sampled.position.shape[0]
    coulomb = axis.unit[COULOMB] * state.mean[COULOMB]
    before, spread = state.mean.copy(), state.covariance.copy()
    age(state.mean, state.covariance, elapsed, restless, axis, before, spread)
    known = known and size > 0 and (not math.isnan(sampled.rest) or sampled.valid[0])
    prepared = prepare(sampled, axis, law, coulomb, before, known, whole)
    if prepared.counted < 3:
        return _nothing(before, spread)
    static = coulomb * (1.0 + before[LEVEL]) * (1.0 + before[ALPHA])
    correct(law, state.forces, static, sampled.rest_force)
    rest = AtRest(state.forces.copy(), coulomb, sampled.rest_force)
    count, slide, stick = size - 2, prepared.slide, prepared.stick
    p = np.zeros(KNOTS + knots_of(count, axis.period, axis.wander))
    for i in range(LEVEL):
        p[i] = before[i]
    found, uncertain = before.copy(), spread.copy()
    masks = axis.masks[_kind_of(prepared)]
    mask = masks[0] if stick == 0 else masks[1] if slide == 0 else masks[2]
    step = _shared_step(axis, coulomb)
    solution = Solution(SOLVED, -1, 0.0, 0)
    evaluations = 0
    if slide > 0:
        solution = solve(
            False, stick > 0, masks[0], prepared, axis, law, rest, step, before, spread, p, found,
            uncertain,
        )  # fmt: skip
        evaluations += solution.evaluations
        if solution.bound >= 0 and stick > 0:
            # Perhaps for taking the encoder for exact; if not, what is left over under all noise
            # says how far the model is from what happened.
            solution = solve(
                False, False, masks[0], prepared, axis, law, rest, step, before, spread, p, found,
                uncertain,
            )  # fmt: skip
            evaluations += solution.evaluations
            if solution.bound >= 0:
                stick = 0
    if stick > 0 and solution.status == SOLVED:
        solution = solve(
            True, False, mask, prepared, axis, law, rest, step, before, spread, p, found, uncertain
        )
        evaluations += solution.evaluations
    # What was found holds at the move's end: so must what it is compared with.
    duration = (count - 1) * axis.period
    wander_on(before, spread, duration, axis)
    if slide == 0 and stick == 0:
        wander_on(found, uncertain, duration, axis)
    if whole and _is_tempered(solution, axis, before, spread, found, uncertain):
        temper(before, spread, found, uncertain, noise_excess(prepared, solution, axis))
    usual = axis.masks[USUAL]
    asked = usual[1] if slide == 0 else usual[2] if stick > 0 else usual[0]
    verdict = judge(prepared, solution, axis, whole, before, spread, found, uncertain)
    return _conclude(
        verdict, prepared, solution, evaluations, stick, axis, law, rest, asked, whole, before,
        spread, found, uncertain, p, state,
    )  # fmt: skip


@kernel()
def _nothing(mean, covariance):  # type: ignore[no-untyped-def]
    """Outcome of a move with next to no samples."""
    return Outcome(
        FEW, -1, 0.0, 0.0, 0, 0, 0, mean, covariance, np.zeros(LEVEL + 1), mean,
        np.ones(LEVEL + 1), np.zeros(LEVEL, np.bool_), np.zeros(4),
    )  # fmt: skip


@kernel()
def _kind_of(prepared):  # type: ignore[no-untyped-def]
    """Kind of move, for the figures that are solved for."""
    if not prepared.shows_stiffness:
        return CALM
    return USUAL if prepared.far else SHORT


@kernel()
def _shared_step(axis, coulomb):  # type: ignore[no-untyped-def]
    """Resolution of which stretches of the force share an error [N]; 0: none; Fc in N."""
    if axis.force_step >= 0.0:
        return axis.force_step
    # Where the model misses more than that, rounding is not what matters.
    missed = axis.model_error * coulomb > 2.0 * axis.force_noise
    return 0.0 if missed else math.sqrt(12.0) * axis.force_noise


@kernel()
def _is_tempered(solution, axis, before, spread, found, uncertain):  # type: ignore[no-untyped-def]
    """Whether a larger misfit makes the move count less: one that is refused anyway is left."""
    return (
        solution.status != FAILED
        and math.sqrt(solution.chi) <= axis.misfit
        and find_jump(axis, before, spread, found, uncertain) < 0
    )


@kernel()
def _conclude(  # type: ignore[no-untyped-def]
    verdict, prepared, solution, evaluations, stick, axis, law, rest, asked, whole, before, spread,
    found, uncertain, p, state,
):  # fmt: skip
    """Believe or refuse, and carry the friction state on (16 arguments: all of `update_move`)."""
    accepted = verdict.code == ACCEPTED
    sliding = np.empty(4)
    sliding[0], sliding[1] = sliding_level(before, spread)
    sliding[2], sliding[3] = sliding[0], sliding[1]
    if solution.status != FAILED:
        sliding[2], sliding[3] = sliding_level(found, uncertain)
    result, variances = found.copy(), np.empty(LEVEL + 1)
    gain, held = np.ones(LEVEL + 1), np.zeros(LEVEL, np.bool_)
    for i in range(LEVEL + 1):
        variances[i] = spread[i, i]
    if accepted:
        for i in range(LEVEL + 1):
            gain[i] = math.sqrt(spread[i, i] / uncertain[i, i])
        held = hold_undetermined(axis, asked, before, spread, found, uncertain)
    else:
        found, uncertain = before, spread
    if whole:
        for i in range(LEVEL + 1):
            state.mean[i] = found[i]
            for j in range(LEVEL + 1):
                state.covariance[i, j] = uncertain[i, j]
    p = np.zeros(p.shape[0])
    for i in range(LEVEL):
        p[i] = found[i]
    p[COULOMB] *= 1.0 + found[LEVEL]
    samples = prepared.samples
    follow_move(p, axis, law, samples, rest, state.forces, state.slips)
    k = samples.heading.shape[0] - 1
    while k >= 0 and samples.heading[k] == 0:
        k -= 1
    if k >= 0:
        state.memory[0] = samples.heading[k]
    state.memory[1] = samples.position[samples.heading.shape[0]]
    return Outcome(
        verdict.code, verdict.figure, verdict.number, math.sqrt(solution.chi), evaluations,
        prepared.slide, stick, found, uncertain, variances, result, gain, held, sliding,
    )  # fmt: skip
