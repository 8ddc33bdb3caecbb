"""The floor: against its definition, and against repeated moves."""

from dataclasses import replace

import numpy as np

from hil_sim.plant import simulate
from sim2real.findings import GapFigures
from sim2real.gap import compare_with_model
from stagedata import AxisSignals, Recording


def laps(stage, seed, laps=6):
    """The same move there and back again and again, on both axes, as the stage records it."""
    t = np.arange(0, 1, 0.01)
    there = np.concatenate(
        (np.zeros(60), 5e-3 * t**3 * (10 - 15 * t + 6 * t**2), np.full(90, 5e-3))
    )
    once = np.concatenate((there, there[::-1]))
    demand = np.round(np.tile(once, laps) / 1e-9)[:, None] * [1e-9, 1e-9]
    offset = np.zeros_like(demand)
    response = simulate(stage, demand, offset, seed)
    axes = {
        name: AxisSignals(
            demand[:, a], offset[:, a], response.position[:, a], response.force[:, a], None,
            np.ones(len(demand), dtype=bool),
        )
        for a, name in enumerate(("x", "y"))
    }  # fmt: skip
    return Recording("", "", "", np.arange(len(demand)) * 1e-3, axes, (), "made here")


def wandering(stage, factor):
    axes = tuple(replace(a, wander=factor * a.wander) for a in stage.axes)
    return replace(stage, axes=axes)


def test_the_floor_is_what_another_draw_of_the_same_stage_shows(stage):
    measured = compare_with_model(laps(stage, 77), stage)
    ratios = [
        np.sqrt(np.mean(measured.residual[axis][signal] ** 2)) / figure
        for axis, signals in measured.floor.rms.items()
        for signal, figure in signals.items()
    ]
    # Three seconds hold six correlation times of the wander: single draws scatter that much.
    assert 0.6 < np.sqrt(np.mean(np.square(ratios))) < 1.6


def test_repeated_moves_confirm_the_floor_or_refute_it(stage):
    for factor, low, high in ((1.0, 0.7, 1.4), (4.0, 2.0, 6.0)):
        checks = compare_with_model(laps(wandering(stage, factor), 5), stage).repeats
        for axis in ("x", "y"):
            assert checks[axis]["force"].moves == 12
            assert low < checks[axis]["force"].ratio < high


def test_without_repeats_there_is_nothing_to_check(stage):
    assert compare_with_model(laps(stage, 5, laps=1), stage, draws=1).repeats == {}


def gap(position, force):
    return {
        "x": {"position": GapFigures(position, 1e-7, "m"), "force": GapFigures(force, 0.1, "N")}
    }


def test_a_coarse_log_is_in_the_floor(stage):
    """Steps of 10 µm and 0.5 N on a stage without any other fault: a gap of about one floor."""
    made = laps(stage, 5)
    coarse = replace(
        made,
        axes={
            name: replace(
                s,
                position_actual=np.rint(s.position_actual / 10e-6) * 10e-6,
                force_actual=np.rint(s.force_actual / 0.5) * 0.5,
            )
            for name, s in made.axes.items()
        },
    )
    measured = compare_with_model(coarse, stage)
    for signals in measured.gap.values():
        for signal, step in (("position", 10e-6), ("force", 0.5)):
            assert signals[signal].floor > 0.5 * step / np.sqrt(12.0)
            assert signals[signal].nominal < 1.3 * signals[signal].floor
