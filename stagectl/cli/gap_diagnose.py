"""`stagectl gap diagnose`: where the gap lies and what causes it."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import click

from stagectl.cli.gap_measure import console_for, gap_table, machine_of
from stagectl.cli.options import FILE, JSON_FILE, OUTPUT, quietly, write_json

if TYPE_CHECKING:
    from rich.console import Console, RenderableType

    from sim2real.attribution import Pairs
    from sim2real.diagnosis import Diagnosis, Progress
    from sim2real.report import GapReport, NextExperiment
    from stagectl.config.machine import Machine

_WHERE_SHOWN = 6
_ABOUT = 7  # characters of the longest "cause", "channel", ...
_ALIKE_SHOWN = 8
_VERDICTS = {
    "no_gap": ("No gap", "green"),
    "explained": ("Explained", "green"),
    "partly_explained": ("Partly explained", "yellow"),
    "unexplained": ("Unexplained", "red"),
    "insufficient": ("Insufficient", "yellow"),
}


@click.command("diagnose", short_help="Where the gap lies, and what causes it.")
@click.argument("recordings", type=FILE, nargs=-1, required=True, metavar="REC.h5...")
@click.option("--machine", type=FILE, help="Machine file to compare [the recordings' own].")
@click.option("--json", "json_out", type=JSON_FILE, help="Write the report here; - is stdout.")
@click.option("--html", "html_out", type=OUTPUT, help="Write the report as a page to look at.")
@click.option("--twin", type=OUTPUT, help="Write the machine file with the effects found.")
@click.option("--next", "next_out", type=OUTPUT, help="Write the moves that would tell most next.")
@click.option("--jobs", type=click.IntRange(1), default=2, show_default=True, help="Threads.")
@click.option(
    "--correct/--no-correct",
    default=False,
    help="Go on with channels corrected for what is wrong with them [no].",
)
def diagnose(
    recordings: tuple[Path, ...],
    machine: Path | None,
    json_out: Path | None,
    html_out: Path | None,
    twin: Path | None,
    next_out: Path | None,
    jobs: int,
    correct: bool,
) -> None:
    """Channels, gap and floor, where the gap lies, and its causes.

    Several recordings of one stage are diagnosed together. Channels come first: units, signs,
    delays, clocks and the controller are checked before any physics is suspected.
    """
    # Each axis has its own thread; linear algebra with threads of its own would fight them.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from hil_sim.effects.library import EffectError, library
    from sim2real import diagnosis
    from sim2real.diagnosis import examine
    from stagectl.config.mapping import stage_settings
    from stagectl.errors import ConfigError, UnusableInput
    from stagectl.store import read_recording

    recorded = [read_recording(path) for path in recordings]
    model = machine_of(machine, *recorded)
    settings = stage_settings(model)
    tolerance = {name: axis.plant.tolerance for name, axis in model.axes.items()}
    quiet = quietly(json_out)
    console = console_for(quiet)
    with _diagnosing(console) as progress:
        try:
            effects = library()
            examined = examine(recorded, settings, correct=correct, progress=progress)
            found = diagnosis.diagnose(examined, tolerance, effects, jobs=jobs, progress=progress)
        except EffectError as error:
            raise ConfigError(f"effects: {error}") from error
        except ValueError as error:
            raise UnusableInput(str(error)) from error
    report = found.report
    if json_out is not None:
        write_json(report.to_json(), json_out)
    if html_out is not None:
        from stagectl.report import write_gap_page

        write_gap_page(
            html_out, report, examined, model.name,
            explained=found.explained or None, likeness=_likeness(found), profiles=found.profiles,
        )  # fmt: skip
    if twin is not None:
        _write_twin(twin, model, report, found.plant)
    if next_out is not None and report.next_experiment is not None:
        next_out.write_text(_recipe(report.next_experiment), encoding="utf-8")
    if not quiet:
        _show(console, report, model.name)
        if next_out is not None and report.next_experiment is None:
            console.print(f"{next_out} is not written: no moves are called for", markup=False)


def _likeness(found: Diagnosis) -> dict[str, Pairs]:
    """How alike the most suspected effects are, on axes with causes; else on all."""
    from sim2real.attribution import signature_similarity

    named = {cause.axis for cause in found.report.causes}
    alike = {}
    for axis, searched in found.searches.items():
        if named and axis not in named:
            continue
        causes = [cause.effect for cause in found.report.causes if cause.axis == axis]
        others = sorted(searched.scanned, key=lambda name: -searched.scanned[name])
        names = list(dict.fromkeys([*causes, *others]))[:_ALIKE_SHOWN]
        alike[axis] = signature_similarity(searched.signatures, names)
    return alike


def _write_twin(
    path: Path, machine: Machine, report: GapReport, plant: Mapping[str, Mapping[str, float]]
) -> None:
    from stagectl.config.twin import twin_text

    effects: dict[str, list[tuple[str, dict[str, float]]]] = {}
    for cause in report.causes:
        parameters = {key: p.value for key, p in cause.parameters.items()}
        effects.setdefault(cause.axis, []).append((cause.effect, parameters))
    path.write_text(twin_text(machine, effects, plant), encoding="utf-8")


def _recipe(experiment: NextExperiment) -> str:
    """A recipe file with the reason above it."""
    import yaml

    return f"# {experiment.why}\n" + yaml.safe_dump(
        experiment.recipe(), sort_keys=False, default_flow_style=None
    )


@contextmanager
def _diagnosing(console: Console) -> Iterator[Progress]:
    from rich.progress import Progress, TimeElapsedColumn

    columns = (*Progress.get_default_columns()[:3], TimeElapsedColumn())
    with Progress(
        *columns, console=console, transient=True, disable=not console.is_terminal
    ) as bar:
        task = bar.add_task("reading", total=None)
        yield lambda what, done, total: bar.update(
            task, description=what, completed=done, total=total
        )


def _show(console: Console, report: GapReport, machine: str) -> None:
    """The report in a screenful."""
    word, colour = _VERDICTS[report.verdict]
    lines = [(f"[bold {colour}]{word}[/]:", report.reason)]
    lines += [
        ("channel", f"{f.text}{' (corrected)' if f.applied else ''}") for f in report.channels
    ]
    console.print(_lines(lines))
    if report.gap is not None:
        console.print(gap_table(report.gap, f"Gap of {machine} (rms)"))
    lines = [("where", cell.text) for cell in report.where[:_WHERE_SHOWN]]
    for cause in report.causes:
        figures = ", ".join(
            f"{key} {p.value:.4g} ± {p.sigma:.2g} {p.unit}" for key, p in cause.parameters.items()
        )
        lines.append(
            ("cause", f"{cause.axis}: {cause.effect}, p = {cause.probability:.2f}: {figures}")
        )
        if cause.remedy:
            lines.append(("", cause.remedy))
    for group in report.confusable:
        lines.append(("alike", f"{group.axis}: {', '.join(group.effects)}: {group.why}"))
    if report.gap_closed is not None:
        interval = report.gap_closed_interval
        held = "" if interval is None else f" ({interval[0]:.2f} to {interval[1]:.2f})"
        lines.append(
            ("closed", f"{report.gap_closed:.2f}{held} of the gap, on moves that took no part")
        )
    if report.next_experiment is not None:
        lines.append(("next", report.next_experiment.why))
    console.print(_lines(lines))


def _lines(lines: Sequence[tuple[str, str]]) -> RenderableType:
    """What each line is about, and beside it what is too long for one line."""
    from rich.markup import escape
    from rich.table import Table

    grid = Table.grid(padding=(0, 2, 0, 0))
    grid.add_column(min_width=_ABOUT, no_wrap=True)
    grid.add_column(overflow="fold")
    for about, text in lines:
        grid.add_row(about, escape(text))
    return grid
