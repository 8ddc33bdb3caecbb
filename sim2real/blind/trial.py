"""One trial: draw and seal a stage, diagnose its recording, and predict a second run of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from hil_sim.effects.effect import Effect
from hil_sim.plant import simulate
from hil_sim.settings import StageSettings
from sim2real.blind.draw import Key, build_stage, draw_key
from sim2real.blind.moves import Demands, draw_demands
from sim2real.blind.outcome import Outcome, ReportedCause
from sim2real.blind.seal import Sealed, seal_key
from sim2real.blind.stage import SUBSTEPS, record_stage, with_elements
from sim2real.diagnosis import Progress, diagnose, examine
from sim2real.findings import GapReport
from sim2real.fitting import AxisModel, compose_stage
from sim2real.gap import (
    combined_gap,
    compare_with_model,
    gap_closed,
    measure_gap,
)
from sim2real.tracking import require_presliding
from stagedata import Recording

_FLOOR_DRAWS = 3


@dataclass(frozen=True, slots=True)
class Setup:
    """What all trials of a check have in common.

    Attributes:
        settings: of the machine file.
        tolerance: axis -> relative standard deviation of the plant's figures.
        library: effects, drawn and searched.
        machine: text of the machine file.
        seed: of all draws.
        leave_out: remove the true effects from the library before the diagnosis.
        only: name of the only effect drawn, None for all.
        elements: friction elements of the real stage, None for the machine file's.
        substeps: plant steps per control tick of the real stage, None to draw one of `SUBSTEPS`.
        jobs: threads of a diagnosis.
        effects: library effects on one axis in every trial; None to draw the kind of trial.
    """

    settings: StageSettings
    tolerance: Mapping[str, float]
    library: Mapping[str, Effect]
    machine: str
    seed: int
    leave_out: bool = False
    only: str | None = None
    elements: int | None = None
    substeps: int | None = None
    jobs: int = 2
    effects: int | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """A stage before its diagnosis.

    Attributes:
        number: from 0.
        key: the answer.
        sealed: the answer under seal.
        first: recording to diagnose.
        second: of the same stage, other moves.
    """

    number: int
    key: Key
    sealed: Sealed
    first: Recording
    second: Recording


def draw_trial(setup: Setup, number: int) -> Trial:
    """Draw moves, effects and base parameters of a trial; run the stage twice; seal the answer.

    Raises:
        ValueError: `only` names no effect, or the stage's friction law cannot be tracked.
    """
    require_presliding(setup.settings)
    rng = np.random.default_rng([setup.seed, number])
    demands = draw_demands(rng, setup.settings)
    other = draw_demands(rng, setup.settings)
    key = draw_key(
        rng, setup.settings, setup.tolerance, setup.library, _gap_measure(setup, demands),
        only=setup.only, several=setup.effects,
    )  # fmt: skip
    stage = build_stage(setup.settings, key, setup.library)
    if setup.elements is not None:
        stage = with_elements(stage, setup.elements)
    substeps = int(rng.choice(SUBSTEPS))
    if setup.substeps is not None:
        substeps = setup.substeps
    seeds = [int(s) for s in rng.integers(2**31, size=2)]
    runs = [
        record_stage(stage, d, s, substeps, setup.machine, f"trial-{number}-{i}")
        for i, (d, s) in enumerate(zip((demands, other), seeds, strict=True))
    ]
    return Trial(number, key, seal_key(key, rng), runs[0], runs[1])


def _gap_measure(setup: Setup, demands: Demands) -> Callable[[StageSettings], float]:
    """A function that returns a stage's combined noise-free gap on these moves, over the floor."""
    settings = setup.settings
    blank = record_stage(settings, demands, 0, SUBSTEPS[0], setup.machine, "blank")
    below = measure_gap(blank, settings, _FLOOR_DRAWS)
    floors = np.array([[f.floor for f in below[a.name].values()] for a in settings.axes])
    plain = simulate(
        settings, demands.position, demands.offset, None, substeps=settings.quick_substeps
    )

    def gap(stage: StageSettings) -> float:
        seen = simulate(
            stage, demands.position, demands.offset, None, substeps=settings.quick_substeps
        )
        off = np.stack((seen.position - plain.position, seen.force - plain.force), axis=-1)
        energy = np.mean(np.square(off), axis=0) / np.square(floors)
        return float(np.sqrt(1.0 + np.mean(energy)))

    return gap


def run_trial(
    setup: Setup,
    trial: Trial,
    clock: Callable[[], float],
    spent: Callable[[], float],
    progress: Progress = lambda *_: None,
) -> Outcome:
    """Diagnose the first run and check the predicted gap closed on the second.

    Args:
        setup: of all trials.
        trial: to diagnose.
        clock: the time [s].
        spent: processor time of this process [s].
        progress: called along the way.
    """
    library = dict(setup.library)
    if setup.leave_out:
        true = [library[drawn.kin] for drawn in trial.key.effects if drawn.kin in library]
        library = {n: e for n, e in library.items() if not any(is_same(e, t) for t in true)}
    begin, begun = clock(), spent()
    error = ""
    found = None
    try:
        examined = examine([trial.first], setup.settings, progress=progress)
        found = diagnose(examined, setup.tolerance, library, jobs=setup.jobs, progress=progress)
    except Exception as problem:  # noqa: BLE001 - one bad trial must not end a long check; it counts
        error = f"{type(problem).__name__}: {problem}"
    seconds, processor = clock() - begin, spent() - begun
    report = None if found is None else found.report
    promised = None if report is None else report.gap_closed
    promised_by_twin = None if report is None else report.gap_closed_by_twin
    second = second_by_twin = within = within_by_twin = None
    inside = only_within(trial.second, trial.first)
    if found is not None and promised is not None:
        second = _closed(trial.second, setup.settings, found.named())
        within = _closed(inside, setup.settings, found.named())
    if found is not None and promised_by_twin is not None:
        second_by_twin = _closed(trial.second, setup.settings, found.twin())
        within_by_twin = _closed(inside, setup.settings, found.twin())
    gap = measure_gap(trial.first, setup.settings, 3)
    return Outcome(
        setup.seed,
        trial.number,
        setup.leave_out,
        trial.key.kind,
        trial.key.effects,
        "" if report is None else report.verdict,
        () if report is None else reported_causes(report),
        () if report is None else tuple((c.axis, c.effects) for c in report.confusable),
        {} if report is None else deviations_in_sigmas(trial.key, report, setup.library),
        math.sqrt(combined_gap(gap)),
        promised,
        second,
        seconds,
        processor,
        trial.sealed.text,
        trial.sealed.nonce,
        trial.sealed.digest,
        error,
        () if report is None else tuple((u.axis, (u.over, *u.alike)) for u in report.unlisted),
        promised_by_twin,
        second_by_twin,
        within,
        within_by_twin,
    )


def is_same(one: Effect, other: Effect) -> bool:
    """Whether two effects do the same: some have a second name on axes with a transmission."""
    return type(one).apply is type(other).apply


def only_within(recording: Recording, other: Recording) -> Recording:
    """A recording whose samples count only where an axis is within its travel in another one."""
    axes = {}
    for name, signals in recording.axes.items():
        travelled = other.axes[name].position_actual[other.axes[name].valid]
        at = signals.position_actual
        inside = (at >= travelled.min()) & (at <= travelled.max())
        axes[name] = replace(signals, valid=signals.valid & inside)
    return replace(recording, axes=axes)


def _closed(
    recording: Recording, settings: StageSettings, models: Mapping[str, AxisModel]
) -> float | None:
    """Share of a recording's gap that models close; None where there is hardly a gap."""
    before = measure_gap(recording, settings)
    after = compare_with_model(recording, compose_stage(settings, models), 1).gap
    return gap_closed(before, after)


def reported_causes(report: GapReport) -> tuple[ReportedCause, ...]:
    """The causes of a report."""
    return tuple(
        ReportedCause(
            cause.axis,
            cause.effect,
            cause.probability,
            cause.gap_closed,
            {key: (p.value, p.sigma) for key, p in cause.parameters.items()},
        )
        for cause in report.causes
    )


def deviations_in_sigmas(
    key: Key, report: GapReport, library: Mapping[str, Effect]
) -> dict[str, float]:
    """(reported - true)/sigma of every parameter of the causes that are named correctly.

    Phases are compared modulo 2 pi; a negative size counts as a positive one, shifted by pi.
    """
    out = {}
    for drawn in key.effects:
        if drawn.effect != drawn.kin:
            continue  # a variant of another shape: its parameters are not comparable
        for cause in report.causes:
            if (cause.axis, cause.effect) != (drawn.axis, drawn.effect):
                continue
            effect = library[drawn.effect]
            values = {name: p.value for name, p in cause.parameters.items()}
            phases = [p.key for p in effect.parameters if p.role == "phase"]
            sizes = [p.key for p in effect.parameters if p.role == "size"]
            if phases and len(sizes) == 1 and values[sizes[0]] < 0.0:
                values[sizes[0]] *= -1.0
                values[phases[0]] += math.pi
            for name, value in values.items():
                off = value - drawn.values[name]
                if name in phases:
                    off = math.remainder(off, 2.0 * math.pi)
                sigma = cause.parameters[name].sigma
                out[f"{drawn.axis}.{drawn.effect}.{name}"] = (
                    off / sigma if sigma > 0.0 else math.nan
                )
    return out
