"""Other methods on the same sealed stages, scored alike.

Each gets what the diagnosis gets: the recording, the machine file with its tolerance, and the
library. None of them reports `no_gap` or a confidence: they are scored by the effects they name and
by the share of the gap that their models close on the second run.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from hil_sim.effects.effect import Effect
from hil_sim.settings import StageSettings
from sim2real.blind.fixed_list import fit_fixed_list
from sim2real.blind.outcome import Baseline
from sim2real.blind.sparse_regression import regress_forces
from sim2real.diagnosis import Examination, examine
from sim2real.fitting import AxisModel, compose_stage
from sim2real.gap import compare_with_model, gap_closed, measure_gap
from stagedata import Recording

Method = Callable[[Examination, Mapping[str, float], Mapping[str, Effect]], Mapping[str, AxisModel]]
METHODS: dict[str, Method] = {
    "fixed list, least squares": fit_fixed_list,
    "forces, sparse regression": regress_forces,
}
"""Name of a method -> function that returns axis -> model with the effects it names."""


def run_baselines(
    settings: StageSettings,
    tolerance: Mapping[str, float],
    library: Mapping[str, Effect],
    runs: tuple[Recording, Recording],
    spent: Callable[[], float],
) -> dict[str, Baseline]:
    """Name of each method -> its result for a trial.

    Args:
        settings: of the machine file.
        tolerance: axis -> relative standard deviation of the plant's figures.
        library: effects by name.
        runs: the recording, and the second run.
        spent: processor time of this process [s].
    """
    found = {}
    for name, method in METHODS.items():
        begun = spent()
        examined = examine(runs[:1], settings)
        if examined.insufficient is not None:
            found[name] = Baseline((), None, spent() - begun)
            continue
        models = method(examined, tolerance, library)
        took = spent() - begun
        named = tuple((axis, term.name) for axis, model in models.items() for term in model.terms)
        second = None
        if named:
            before = measure_gap(runs[1], settings)
            twin = compose_stage(settings, models)
            second = gap_closed(before, compare_with_model(runs[1], twin, 1).gap)
        found[name] = Baseline(named, second, took)
    return found
