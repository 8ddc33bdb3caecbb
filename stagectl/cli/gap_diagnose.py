"""`stagectl gap diagnose`: where the gap is and which physical effects cause it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

from stagectl.cli.file_kinds import HTML, JSON, MACHINE_FILE, RECIPE_FILE
from stagectl.cli.files import Output, check_output
from stagectl.cli.options import (
    FILE,
    JSON_OUT,
    RECORDING,
    is_json_on_stdout,
    option,
    takes,
    write_json,
)
from stagectl.cli.terminal import console_for, join_phases, progress_bar
from stagectl.diagnosis import diagnose_recordings, machine_of

if TYPE_CHECKING:
    from hil_sim.effects import Value
    from hil_sim.settings import StageSettings
    from sim2real.attribution import Pairs
    from sim2real.diagnosis import Diagnosis, Examination
    from sim2real.findings import GapReport, NextExperiment
    from sim2real.residuals import ResidualViews
    from stagectl.config import Machine

_MAX_COMPARED = 8  # effects whose similarity is shown


@dataclass(frozen=True)
class _Outputs:
    """What is written beside the terminal and JSON."""

    html: Path | None = option("Write the report as an HTML page.", Output(HTML))
    twin: Path | None = option(
        "Write the machine file with the causes found added, and a table of what none explains.",
        Output(MACHINE_FILE),
    )
    next: Path | None = option(
        "Write a recipe of the moves that would settle most open questions.", Output(RECIPE_FILE)
    )


@dataclass(frozen=True)
class _How:
    """How the search goes."""

    jobs: int = option("Threads to fit with.", click.IntRange(1), 2)
    correct: bool = option(
        "Correct faulty channels and continue with them.  [default: no]",
        default=False,
        flags="--correct/--no-correct",
        show_default=False,
    )


@click.command("diagnose")
@click.argument("recordings", type=RECORDING, nargs=-1, required=True, metavar="REC.h5...")
@click.option(
    "--machine", type=FILE, help="Machine file to examine.  [default: the recordings' own]"
)
@JSON_OUT
@click.option(
    "--check",
    "checks",
    type=RECORDING,
    multiple=True,
    metavar="REC.h5",
    help="Judge the causes on this recording too, which takes no part in finding them; repeatable.",
)
@takes(_Outputs)
@takes(_How)
def diagnose(
    outputs: _Outputs,
    how: _How,
    recordings: tuple[Path, ...],
    machine: Path | None,
    json_out: Path | None,
    checks: tuple[Path, ...],
) -> None:
    """Find out where simulation and recording differ and which physical effects cause it.

    The channels of the recording are checked first: units, signs, delays, clocks and the control
    law. Then gap and floor are measured, effects are fitted, and what they explain is tested on
    held-out moves. Several recordings of one stage are diagnosed together; recordings of --check
    only judge what was found.

    \b
    Verdicts:
      No gap             the machine file describes the stage down to its noise
      Explained          the causes listed close nearly all of the gap
      Partly explained   the causes listed close some of it
      Unexplained        there is a gap, and no known effect accounts for it
      Insufficient       these recordings cannot support a diagnosis

    A cause comes with its parameters (±1 sigma), its probability p and the usual remedy; effects
    that these recordings cannot tell apart are listed together.
    """  # noqa: D301  (\b keeps click from wrapping what follows)
    from sim2real.diagnosis import PHASES
    from sim2real.residuals import residuals_json, view_residuals
    from stagectl.importing.log_machine import load_machine_of
    from stagectl.report import print_outline
    from stagectl.report.gap import diagnosis_outline
    from stagectl.store import read_recording

    recorded = [read_recording(path) for path in recordings]
    others = [read_recording(path) for path in checks]
    model = (
        machine_of(None, *recorded, fitted=True)
        if machine is None
        else load_machine_of(machine, recorded)
    )
    console = console_for(json_out)
    with progress_bar(console, "reading") as update:
        done = diagnose_recordings(
            recorded, model, others=others, jobs=how.jobs, correct=how.correct,
            progress=join_phases(PHASES, update),
        )  # fmt: skip
    if done.left_out is not None:
        click.echo(f"--check is left out: {done.left_out}", err=True)
    examined, found, report = done.examined, done.found, done.found.report
    if json_out is not None or outputs.html is not None:
        views = view_residuals(examined.measured, found.explained or None, examined.settings)
        write_json(report.to_json() | residuals_json(views), json_out)
        if outputs.html is not None:
            _write_page(outputs.html, examined, found, model.name, views)
    if not is_json_on_stdout(json_out):
        outline = diagnosis_outline(report, model.name, examined.measured)
        console.print(print_outline(outline), crop=False)
        for line in _left_out(outputs, model, report):
            console.print(line, soft_wrap=True)
    # After the report: if one of them cannot be written, the diagnosis is not lost.
    if outputs.next is not None and report.next_experiment is not None:
        _write_recipe(outputs.next, report.next_experiment)
    if outputs.twin is not None and _has_twin(report):
        _write_twin(outputs.twin, model, found, examined.settings)
        _keep_measurement(outputs.twin, recordings)


def _write_page(
    path: Path,
    examined: Examination,
    found: Diagnosis,
    machine: str,
    views: Mapping[str, ResidualViews],
) -> None:
    from stagectl.report.gap import render_gap_page
    from stagectl.store import write_atomically

    page = render_gap_page(
        found.report,
        examined,
        machine,
        explained=found.explained or None,
        similarity=_similarity(found),
        views=views,
    )
    write_atomically(path, page, "report")


def _has_twin(report: GapReport) -> bool:
    from sim2real.findings import NO_GAP

    return bool(report.causes or report.empirical) or report.verdict == NO_GAP


def _left_out(outputs: _Outputs, machine: Machine, report: GapReport) -> Iterator[str]:
    """What is not written, or cannot run, and why."""
    from sim2real.diagnosis.examination import GAINS

    if outputs.next is not None and report.next_experiment is None:
        yield f"{outputs.next} is not written: no moves to propose"
    if outputs.twin is None:
        return
    without = [name for name, figures in machine.unknown.items() if GAINS in figures]
    if not _has_twin(report):
        yield (
            f"{outputs.twin} is not written: no cause was found, nor a smooth force that describes "
            "the gap"
        )
    elif without:
        yield (
            f"{outputs.twin} is for `gap measure` and `gap compare` and cannot run: the controller "
            f"gains of {', '.join(without)} stay unknown, which no diagnosis finds"
        )


def _keep_measurement(twin: Path, recordings: Sequence[Path]) -> None:
    """Put the measurement of a real stage beside its twin: it is on the same drives."""
    from stagectl.measurement import SUFFIX
    from stagectl.run import recorded_measurement
    from stagectl.store import write_atomically

    for path in recordings:
        measurement = recorded_measurement(path)
        if measurement is not None and measurement.measured is not None:
            beside = twin.with_suffix(SUFFIX)
            check_output(beside, JSON)
            write_atomically(beside, measurement.as_text(), "measurement")
            return


def _similarity(found: Diagnosis) -> dict[str, Pairs]:
    """Similarity of the most likely effects, on axes with causes or, without any, on all axes."""
    from sim2real.attribution import signature_similarity

    named = {cause.axis for cause in found.report.causes}
    similarity = {}
    for axis, searched in found.searches.items():
        if named and axis not in named:
            continue
        causes = [cause.effect for cause in found.report.causes if cause.axis == axis]
        others = sorted(searched.scanned, key=lambda name: -searched.scanned[name].gain)
        names = list(dict.fromkeys([*causes, *others]))[:_MAX_COMPARED]
        signatures = {name: candidate.signature for name, candidate in searched.scanned.items()}
        similarity[axis] = signature_similarity(signatures, names)
    return similarity


def _write_twin(path: Path, machine: Machine, found: Diagnosis, examined: StageSettings) -> None:
    """Write the twin: causes with the figures fitted beside them, and what none explains."""
    from stagectl.config.machine.twin import render_twin
    from stagectl.store import write_atomically

    effects: dict[str, list[tuple[str, dict[str, Value]]]] = {}
    plant = {axis: _found_figures(machine, examined, axis) for axis in machine.unknown}
    for figure in found.report.fitted:
        plant[figure.axis][figure.figure] = figure.value
    for axis, figures in found.plant.items():
        plant[axis] = {**plant.get(axis, {}), **figures}
    comments = []
    for cause in found.report.causes:
        parameters: dict[str, Value] = {key: p.value for key, p in cause.parameters.items()}
        effects.setdefault(cause.axis, []).append((cause.effect, parameters))
    for force in found.report.empirical:
        if force.axis not in effects:  # described beside the figures examined
            plant[force.axis] = _found_figures(machine, examined, force.axis)
        described = force.effects()
        effects.setdefault(force.axis, []).extend(described)
        places, speeds = force.position, force.velocity
        names = " and ".join(dict.fromkeys(name for name, _ in described))
        repeats = f" it repeats every {force.period:.4g}, and beyond" if force.period else " and"
        comments += [
            f"On {force.axis}, {names}: a description and no cause. It closes "
            f"{100 * force.gap_closed:.0f} % of what is otherwise left of the force,",
            f"on held-out strokes; beyond {places[0]:.4g} to {places[-1]:.4g}{repeats} speeds of "
            f"{speeds[1]:.3g} to {speeds[-2]:.3g} it extrapolates.",
        ]
    for figure in found.report.fitted:
        value = plant[figure.axis][figure.figure]
        comments.append(
            f"{figure.figure} of {figure.axis}: {value:.4g} {figure.unit} fitted; the machine file "
            f"leaves it unknown."
        )
    text = render_twin(machine, effects, plant, comments, path.parent)
    write_atomically(path, text, "machine file")


def _found_figures(machine: Machine, examined: StageSettings, axis: str) -> dict[str, float]:
    """What the machine file leaves unknown of an axis' plant, as the examination found it."""
    from sim2real.fitting import BASE, plant_figure

    settings = next(own for own in examined.axes if own.name == axis)
    return {
        key: plant_figure(settings, key) for key in machine.unknown.get(axis, ()) if key in BASE
    }


def _write_recipe(path: Path, experiment: NextExperiment) -> None:
    """Write a recipe file with the reason above it."""
    import yaml

    from stagectl.store import write_atomically

    moves = yaml.safe_dump(experiment.recipe(), sort_keys=False, default_flow_style=None)
    write_atomically(path, f"# {experiment.why}\n{moves}", "recipe")
