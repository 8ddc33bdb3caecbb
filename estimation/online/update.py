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

from estimation.friction.law import correct
from estimation.online.belief.arrival_cost import age, copy, decay, knots_of
from estimation.online.belief.belief import (
    ALPHA,
    COULOMB,
    FORCE,
    KNOTS,
    LEVEL,
    MASS,
    STATES,
    Belief,
)
from estimation.online.belief.scatter import scattered, temper
from estimation.online.judge import (
    find_jump,
    hold_undetermined,
    is_another_scale,
    judge,
    noise_excess,
    normalised_innovations,
    sliding_level,
)
from estimation.online.outcome import ACCEPTED, JUMP, Outcome
from estimation.online.settings import CALM, SHORT, USUAL
from estimation.online.solver.prepare import prepare
from estimation.online.solver.residual import AtRest, follow_move
from estimation.online.solver.solve import FAILED, SOLVED, Problem, Solution, model_variance, solve
from stagedata import F64
from stagedata.compiled import kernel


class State(NamedTuple):
    """What is known between moves, for the kernels; changed in place.

    Attributes:
        belief: mean and covariance.
        forces: internal forces of the friction law at rest [N], shape (n,).
        slips: which of them slide, shape (n,).
        memory: direction of motion, and position up to which it was taken [m].
    """

    belief: Belief
    forces: F64
    slips: NDArray[np.bool_]
    memory: F64


@kernel()
def update_move(sampled, axis, law, state, elapsed, trend_variance, known, whole):  # type: ignore[no-untyped-def]
    """Learn from a move, and carry the friction state to its end.

    Args:
        sampled: the move, of three valid samples at least.
        axis: settings.
        law: constants of the friction law.
        state: after the last move; updated, of a move that is not over only the friction state.
        elapsed: since the end of the last move [s]; negative: there was none.
        trend_variance: variance by which Coulomb force ages beside its drift, relative.
        known: False where only the sum of the internal forces is known; so it is where neither the
            position at rest nor the first sample is.
        whole: False for a look at a move that is not over: zone A only.
    """
    coulomb = axis.unit[COULOMB] * state.belief.mean[COULOMB]
    before = age(state.belief, elapsed, trend_variance, axis)
    known = known and (not math.isnan(sampled.rest) or sampled.valid[0])
    prepared = prepare(sampled, axis, law, coulomb, before.mean, known, whole)
    static = coulomb * (1.0 + before.mean[LEVEL]) * (1.0 + before.mean[ALPHA])
    unmodelled = axis.unit[COULOMB] * before.mean[FORCE]
    correct(law, state.forces, static, sampled.rest_force - unmodelled)
    rest = AtRest(state.forces.copy(), coulomb, sampled.rest_force)
    time, place, share = _measure_progress(prepared.samples.position, axis)
    problem = Problem(
        axis, law, prepared, rest, _shared_step(axis, coulomb), time, place, share,
        knots_of(time + place, axis),
    )  # fmt: skip
    after = copy(before)
    met = scattered(before, axis)
    solution, stick = _solve_zones(problem, met, after)
    # What was found holds at the move's end: so must what it is compared with.
    decay(before, time, place, axis)
    decay(met, time, place, axis)
    if prepared.slide == 0 and stick == 0:
        decay(after, time, place, axis)
    scatter = np.zeros((2, MASS))
    if whole and solution.status != FAILED:
        tempered = _is_tempered(solution, prepared.slide, axis, met, after)
        excess = noise_excess(prepared, solution, axis) if tempered else 1.0
        scatter = temper(before, met, after, excess)
    missed = _missed(solution, axis, coulomb)
    verdict = judge(prepared, solution, math.sqrt(max(missed, 0.0)), axis, whole, before, after)
    if verdict.code != ACCEPTED and verdict.code != JUMP:
        scatter[:] = 0.0
    asked = axis.masks[USUAL, _zones_of(prepared.slide, stick)]
    innovations = normalised_innovations(verdict, axis, before, after)
    found, gain, held, sliding = _settle(verdict, solution, axis, asked, before, after)
    believed = after if verdict.code == ACCEPTED else before
    if whole:
        state.belief.mean[:] = believed.mean
        state.belief.covariance[:] = believed.covariance
    _carry_state(problem, believed, state)
    return Outcome(
        verdict.code, verdict.figure, verdict.number, math.sqrt(solution.chi),
        prepared.slide, stick, prepared.onset_seen, believed.mean, believed.covariance,
        np.diag(before.covariance), found, gain, held, sliding, solution.unmodelled,
        solution.wander, missed, innovations, scatter,
    )  # fmt: skip


@kernel()
def _measure_progress(position, axis):  # type: ignore[no-untyped-def]
    """Time and way of a move in correlation times and lengths, and shares of their sum, shape (K,).

    Level and unmodelled force change with both. `position` [m], shape (K + 2,).
    """
    count = position.shape[0] - 2
    share, farthest = np.empty(count), 0.0
    by_time = axis.period / axis.correlation_time
    by_place = 1.0 / axis.unmodelled_length if axis.unmodelled > 0.0 else 0.0
    for k in range(count):
        farthest = max(farthest, abs(position[k + 1] - position[0]))
        share[k] = k * by_time + farthest * by_place
    last = max(share[count - 1], 1e-300)
    for k in range(count):
        share[k] /= last
    return (count - 1) * by_time, farthest * by_place, share


@kernel()
def _missed(solution, axis, coulomb):  # type: ignore[no-untyped-def]
    """Mean square of what the model missed in the move, relative to `coulomb` [N].

    It follows from the residual, or from sums over neighbouring samples if these are larger,
    whitened for the usual model error: a larger assumed error would confirm itself where the
    encoder's noise hides the real one.
    """
    noise, usual = axis.force_noise**2, (axis.usual_error * coulomb) ** 2
    most = axis.misfit**2 * (noise + model_variance(axis, coulomb))
    return (min(solution.under_usual * (noise + usual), most) - noise) / coulomb**2


@kernel()
def _zones_of(slide, stick):  # type: ignore[no-untyped-def]
    """Row of a kind's masks (`settings.AXIS`), by the samples in zone A and in stick zones."""
    return 0 if stick == 0 else 1 if slide == 0 else 2


@kernel()
def _solve_zones(problem, before, after):  # type: ignore[no-untyped-def]
    """Solve zone A, and then all that is usable, as far as there is anything to solve.

    Where that ends on a bound, zone A alone is believed.

    `before`: belief before the move; `after`: written. Returns the last solution, and samples of
    the stick zones used.
    """
    prepared, axis = problem.prepared, problem.axis
    slide, stick = prepared.slide, prepared.stick
    p = np.zeros(KNOTS + problem.knots * ((axis.wander > 0.0) + (axis.unmodelled > 0.0)))
    for i in range(LEVEL):
        p[i] = before.mean[i]
    masks = axis.masks[_kind_of(prepared)]
    solution = Solution(SOLVED, -1, 0.0, 0.0, 0.0, (0.0, 0.0), (0.0, 0.0))
    if slide > 0:
        solution = solve(problem, False, stick > 0, masks[0], before, p, after)
        if solution.bound >= 0 and stick > 0:
            # Perhaps for taking the encoder for exact; if not, what is left over under all noise
            # says how far the model is from what happened.
            solution = solve(problem, False, False, masks[0], before, p, after)
            if solution.bound >= 0:
                stick = 0
    if stick > 0 and solution.status == SOLVED:
        solution = solve(problem, True, False, masks[_zones_of(slide, stick)], before, p, after)
        if slide > 0 and solution.bound >= 0:
            # What sticks is not as the law has it, which zone A does not depend on.
            for i in range(p.shape[0]):
                p[i] = before.mean[i] if i < LEVEL else 0.0
            solution, stick = solve(problem, False, False, masks[0], before, p, after), 0
    return solution, stick


@kernel()
def _kind_of(prepared):  # type: ignore[no-untyped-def]
    """Kind of move, for the figures that are solved for."""
    if not prepared.shows_stiffness:
        return CALM
    return USUAL if prepared.far else SHORT


@kernel()
def _shared_step(axis, coulomb):  # type: ignore[no-untyped-def]
    """Resolution of the force for `share_rounding` [N]; 0: not applied. `coulomb`: Fc [N]."""
    # Where the model misses more than that, rounding is not what matters.
    missed = axis.model_error * coulomb > 2.0 * axis.force_noise
    return 0.0 if missed else math.sqrt(12.0) * axis.force_noise


@kernel()
def _is_tempered(solution, slide, axis, before, after):  # type: ignore[no-untyped-def]
    """Whether a large misfit should reduce the weight of a move: not if it is refused anyway.

    `before` and `after`: of the figures as the move has them.
    `slide`: samples of zone A.
    """
    return (
        math.sqrt(solution.chi) <= axis.misfit
        and find_jump(axis, before, after) < 0
        and not is_another_scale(slide, axis, before, after)
    )


@kernel()
def _settle(verdict, solution, axis, asked, before, after):  # type: ignore[no-untyped-def]
    """Reset figures that an accepted move does not determine to their prior, in `after`.

    `asked`: figures that were solved for, shape (LEVEL,). Returns `Outcome`'s found, gain, held and
    sliding.
    """
    sliding = np.empty(4)
    sliding[0], sliding[1] = sliding_level(before)
    sliding[2], sliding[3] = sliding_level(after if solution.status != FAILED else before)
    found, gain, held = after.mean.copy(), np.ones(STATES), np.zeros(LEVEL, np.bool_)
    if verdict.code == ACCEPTED:
        for i in range(STATES):
            gain[i] = math.sqrt(before.covariance[i, i] / after.covariance[i, i])
        held = hold_undetermined(axis, asked, before, after)
        for i in range(LEVEL):  # what was held has moved the others along straight lines
            after.mean[i] = min(max(after.mean[i], axis.lower[i]), axis.upper[i])
    return found, gain, held, sliding


@kernel()
def _carry_state(problem, belief, state):  # type: ignore[no-untyped-def]
    """Carry the friction state to the end of the move, with the figures now believed."""
    samples = problem.prepared.samples
    p = np.zeros(KNOTS)
    for i in range(LEVEL):
        p[i] = belief.mean[i]
    p[COULOMB] *= 1.0 + belief.mean[LEVEL]
    total = problem.rest.total - problem.axis.unit[COULOMB] * belief.mean[FORCE]
    rest = AtRest(problem.rest.forces, problem.rest.known, total)
    follow_move(p, problem.axis, problem.law, samples, rest, state.forces, state.slips)
    k = samples.heading.shape[0] - 1
    while k >= 0 and samples.heading[k] == 0:
        k -= 1
    if k >= 0:
        state.memory[0] = samples.heading[k]
    state.memory[1] = samples.position[samples.heading.shape[0]]
