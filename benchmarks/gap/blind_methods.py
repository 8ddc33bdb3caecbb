"""The diagnosis beside two other methods, on the same sealed stages.

    python -m benchmarks.gap.blind_methods [--trials 8] [--seeds 4131 4132] [--docs docs/blind.md]

Stages are drawn, sealed and scored as by `stagectl gap blind`. The others (`peers/fixed_list.py`,
`peers/sparse_regression.py`) get what the diagnosis gets: recording, machine file with its
tolerance, library. They report neither `no_gap` nor a confidence, so all are scored by the effects
that they name and by the share of the gap that their models close on a second run.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from benchmarks.peers.fixed_list import fit_fixed_list
from benchmarks.peers.sparse_regression import regress_forces
from hil_sim.effects.effect import Effect
from hil_sim.effects.library import library
from sim2real.blind import Outcome, Setup, draw_trial, run_trial
from sim2real.blind.score import Pair, confident, true_pairs
from sim2real.blind.trial import Trial
from sim2real.diagnosis import Examination, examine
from sim2real.fitting import AxisModel, compose_stage
from sim2real.gap import compare_with_model, gap_closed, measure_gap
from stagectl.config.machine.file import load_machine
from stagectl.config.settings.package_settings import stage_settings

Method = Callable[[Examination, Mapping[str, float], Mapping[str, Effect]], Mapping[str, AxisModel]]
METHODS: dict[str, Method] = {
    "fixed list, least squares": fit_fixed_list,
    "forces, sparse regression": regress_forces,
}
"""Name of a method -> function that returns axis -> model with the effects it names."""
HEADING = "## Beside other methods"


@dataclass(frozen=True)
class Answer:
    """What a method said of a trial.

    Attributes:
        kind: of the trial.
        true, named: (axis, effect).
        closed: gap that its model closed on the second run, None where it named nothing.
        processor: processor time [s].
    """

    kind: str
    true: set[Pair]
    named: set[Pair]
    closed: float | None
    processor: float


def own_answer(outcome: Outcome) -> Answer:
    """What the diagnosis said."""
    true, named = true_pairs(outcome), confident(outcome)
    return Answer(outcome.kind, true, named, outcome.second, outcome.processor)


def ask(method: Method, setup: Setup, trial: Trial, outcome: Outcome) -> Answer:
    """What another method says of the same trial."""
    begun = time.process_time()
    examined = examine([trial.first], setup.settings)
    models: Mapping[str, AxisModel] = {}
    if examined.insufficient is None:
        models = method(examined, setup.tolerance, setup.library)
    took = time.process_time() - begun
    named = {(axis, term.name) for axis, model in models.items() for term in model.terms}
    closed = None
    if named:
        before = measure_gap(trial.second, setup.settings)
        twin = compose_stage(setup.settings, models)
        closed = gap_closed(before, compare_with_model(trial.second, twin, 1).gap)
    return Answer(outcome.kind, true_pairs(outcome), named, closed, took)


KINDS = (
    ("one effect: named", ("one",), lambda a: a.true <= a.named),
    ("one effect: named, and nothing else", ("one",), lambda a: a.true == a.named),
    ("two effects: both named", ("two",), lambda a: a.true <= a.named),
    ("two effects: both, and nothing else", ("two",), lambda a: a.true == a.named),
    ("no effect, or of no family: nothing named", ("none", "outside"), lambda a: not a.named),
)
"""Row, kinds of trial that it counts, and what counts."""


def rows(tables: Sequence[Sequence[Answer]]) -> list[list[str]]:
    """What is counted, then each method's count; `tables`: answers of each to the same trials."""
    found = []
    for text, kinds, holds in KINDS:
        counts = [[holds(a) for a in table if a.kind in kinds] for table in tables]
        if counts[0]:
            found.append([text, *(f"{sum(each)} of {len(each)}" for each in counts)])
    closed = [[a.closed or 0.0 for a in table if a.kind in ("one", "two")] for table in tables]
    if closed[0]:
        medians = (f"{np.median(each):.2f}" for each in closed)
        found.append(["gap closed on the second run, median", *medians])
    spent = (f"{np.median([a.processor for a in table]):.0f}" for table in tables)
    return [*found, ["processor seconds, median", *spent]]


def section(tables: Sequence[Sequence[Answer]]) -> str:
    """The last section of docs/blind.md."""
    head = ["", "this diagnosis", *METHODS]
    lines = [head, ["---"] * len(head), *rows(tables)]
    return "\n".join(
        [
            HEADING,
            "",
            "`python -m benchmarks.gap.blind_methods --docs docs/blind.md` wrote this section:",
            f"{len(tables[0])} stages, the same recording, machine file and library for all. Of",
            "the library the fixed list holds eight effects, and forces show nothing of what acts",
            "within the control loop.",
            "",
            *(f"| {' | '.join(line)} |" for line in lines),
            "",
        ]
    )


def main() -> None:
    """Ask everybody about each trial in turn, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--trials", type=int, default=8, help="stages of each seed [8]")
    parser.add_argument("--seeds", type=int, nargs="+", default=[4131], help="of the draws [4131]")
    parser.add_argument("--docs", type=Path, help="replace the section of this page")
    arguments = parser.parse_args()
    machine = load_machine(None)
    tolerance = {name: axis.plant.tolerance for name, axis in machine.axes.items()}
    tables: list[list[Answer]] = [[] for _ in range(1 + len(METHODS))]
    for seed in arguments.seeds:
        setup = Setup(stage_settings(machine), tolerance, library(), machine.document.text, seed)
        for number in range(arguments.trials):
            trial = draw_trial(setup, number)
            outcome = run_trial(setup, trial, time.perf_counter, time.process_time)
            tables[0].append(own_answer(outcome))
            for table, method in zip(tables[1:], METHODS.values(), strict=True):
                table.append(ask(method, setup, trial, outcome))
            print(f"{seed}, {number}: {' | '.join(str(sorted(t[-1].named)) for t in tables)}")
    text = section(tables)
    print(f"\n{text}")
    if arguments.docs is not None:
        page = arguments.docs.read_text(encoding="utf-8").partition(HEADING)[0]
        arguments.docs.write_text(f"{page.rstrip()}\n\n{text}", encoding="utf-8")


if __name__ == "__main__":
    main()
