"""The tracking filter: what it leaves of the right model, and how it responds to another."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hil_sim.effects.library import library
from hil_sim.settings import SUBSTEPS
from sim2real.fitting import NUISANCES, STEP, AxisModel, Term
from sim2real.tracking import innovation_response
from tests.unit.sim2real.conftest import problem_of, stage_with


def test_response_to_a_force_is_what_a_simulation_shows(nominal):
    recording = stage_with(nominal, 3)
    settings = nominal[1]
    problem = problem_of(recording, settings, "x")
    track, gains = problem.tracks[0], problem.gains[0]
    term = Term(library()["cogging"], (0.3, 0.03, 1.0))
    simulated = problem.track(AxisModel(np.zeros(NUISANCES), (term,)))[0].position - track.position
    force = -0.3 * np.sin(2.0 * np.pi * track.x / 0.03 + 1.0)
    predicted = -innovation_response(gains, gains.force, force)
    assert np.corrcoef(simulated, predicted)[0, 1] > 0.9


def test_models_side_by_side_are_tracked_as_each_by_itself(nominal):
    problem = problem_of(*nominal)
    base = problem.start.base.copy()
    base[0], base[STEP] = 0.01, 0.4
    heavier, nothing = AxisModel(base), problem.start
    waved = nothing.added(Term(library()["cogging"], (0.3, 0.03, 1.0)))
    tied = nothing.added(Term(library()["cross_coupling"], (0.1,)))
    weightless = nothing.added(Term(library()["payload_mass"], (-1e3,)))
    models = [heavier, waved, weightless, tied, nothing]
    each = [None if m is weightless else problem.residual(m) for m in models]
    for found, own in zip(problem.residuals(models), each, strict=True):
        assert (found is None) == (own is None)
        if found is not None:
            np.testing.assert_array_equal(found, own)
    assert problem.residuals_or_worst([weightless])[0].min() > 1e3
    finer, models = problem.finer(), [heavier, nothing, waved]
    for found, model in zip(finer.residuals(models), models, strict=True):
        np.testing.assert_array_equal(found, finer.residual(model))


def test_long_control_periods_are_simulated_in_the_references_steps(nominal):
    settings = nominal[1]
    slow = replace(
        settings,
        axes=tuple(replace(a, control=replace(a.control, period=1e-3)) for a in settings.axes),
    )
    assert settings.quick_substeps == 1
    assert slow.quick_substeps == SUBSTEPS


def test_a_recording_may_begin_where_the_axis_still_creeps(nominal):
    """What integrator and friction hold there, no sample says."""
    recording = stage_with(nominal, 5, x={"force_offset": {"force": 1.5}})
    model = problem_of(recording, nominal[1]).start.added(Term(library()["force_offset"], (1.5,)))

    def share_of_noise(recording):
        problem = problem_of(recording, nominal[1])
        problem.retune(model)
        return problem.cost(model, problem.residual(model)) / problem.expected_cost()

    still = np.diff(recording.axes["x"].position_demand) == 0.0
    arrived = np.flatnonzero(~still[:-1] & still[1:]) + 2
    error = recording.axes["x"].position_demand - recording.axes["x"].position_actual
    far_off = arrived[np.abs(error[arrived]) > 1e-6][:3]
    assert len(far_off) == 3
    for begin in far_off:
        assert share_of_noise(cut(recording, begin)) < 1.5 * share_of_noise(recording)


def cut(recording, begin):
    """The recording from a sample on."""
    axes = {
        name: replace(
            of,
            position_demand=of.position_demand[begin:],
            force_offset=of.force_offset[begin:],
            position_actual=of.position_actual[begin:],
            force_actual=of.force_actual[begin:],
            valid=of.valid[begin:],
        )
        for name, of in recording.axes.items()
    }
    return replace(recording, time=recording.time[begin:], axes=axes, moves=())
