"""`stagectl gap measure` and `compare`: the gap of machine files; nothing is fitted."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from stagectl.cli.options import FILE, JSON_FILE, quietly, write_json

if TYPE_CHECKING:
    from rich.console import Console

    from hil_sim.settings import StageSettings
    from sim2real.gap import Gap, Measured
    from sim2real.report import GapFigures
    from stagectl.config.machine import Machine
    from stagedata import Recording


@click.command("measure", short_help="The gap of a machine file against a recording.")
@click.argument("recording", type=FILE)
@click.option("--machine", type=FILE, help="Machine file to compare [the recording's own].")
@click.option("--json", "json_out", type=JSON_FILE, help="Write the figures here; - is stdout.")
def measure(recording: Path, machine: Path | None, json_out: Path | None) -> None:
    """Simulate RECORDING's demands in closed loop and compare; nothing is fitted.

    The gap is the rms of recorded minus simulated, noise-free. The floor is what a perfect model
    would still show, for encoder noise and the repeatability that the machine file states; where
    the recording repeats moves, it is checked against them.
    """
    from sim2real.report import FORMAT, VERSION, gap_json
    from stagectl.config.mapping import stage_settings
    from stagectl.store import read_recording

    recorded = read_recording(recording)
    model = machine_of(machine, recorded)
    quiet = quietly(json_out)
    console = console_for(quiet)
    with _simulating(console) as progress:
        found = _measured(recorded, stage_settings(model), progress)
    if json_out is not None:
        report = {"format": FORMAT, "version": VERSION, "recordings": [str(recording)]}
        write_json({**report, "gap": gap_json(found.gap)}, json_out)
    if not quiet:
        console.print(gap_table(found.gap, f"Gap of {model.name} against {recording.name} (rms)"))
        for line in repeat_lines(found):
            console.print(line, markup=False, highlight=False)


@click.command("compare", short_help="Two machine files against the same recordings.")
@click.argument("first", type=FILE, metavar="A.yaml")
@click.argument("second", type=FILE, metavar="B.yaml")
@click.argument("recordings", type=FILE, nargs=-1, required=True, metavar="REC.h5...")
@click.option("--json", "json_out", type=JSON_FILE, help="Write the figures here; - is stdout.")
def compare(first: Path, second: Path, recordings: tuple[Path, ...], json_out: Path | None) -> None:
    """Which of two machine files is closer to the recordings, and by how much.

    Nothing is fitted. Gap closed is that of B over A, above A's floor.
    """
    from sim2real.gap import gap_closed, pool_gaps
    from sim2real.report import FORMAT, VERSION, GapFigures, gap_json
    from stagectl.config.machine_file import load_machine
    from stagectl.config.mapping import stage_settings
    from stagectl.store import read_recording

    machines = [load_machine(path) for path in (first, second)]
    settings = [stage_settings(machine) for machine in machines]
    recorded = [read_recording(path) for path in recordings]
    quiet = quietly(json_out)
    console = console_for(quiet)
    gaps = []
    with _simulating(console) as progress:
        for model in settings:
            each = [(_measured(r, model, progress).gap, len(r)) for r in recorded]
            gaps.append(pool_gaps(each))
    before, after = gaps
    share = gap_closed(before, after)
    both: Gap = {
        axis: {
            signal: GapFigures(figures.nominal, figures.floor, figures.unit, other.nominal)
            for (signal, figures), other in zip(signals.items(), after[axis].values(), strict=True)
        }
        for axis, signals in before.items()
    }
    if json_out is not None:
        report = {
            "format": FORMAT,
            "version": VERSION,
            "recordings": [str(path) for path in recordings],
            "machines": [str(first), str(second)],
        }
        write_json({**report, "gap": gap_json(both), "gap_closed": share}, json_out)
    if not quiet:
        console.print(
            gap_table(both, f"Gap of {first.name} (A) and {second.name} (B) (rms)", "A", "B")
        )
        console.print(closed_line(share), markup=False, highlight=False)


def closed_line(share: float | None) -> str:
    """Gap closed in words."""
    if share is None:
        return "A is too close to its floor, or too far off, for a share of the gap to be closed."
    if share < 0:
        return f"B is farther from the recordings than A: gap closed {share:.2f}."
    return f"B closes {share:.2f} of A's gap (1 is all of it)."


def repeat_lines(found: Measured) -> list[str]:
    """What the recording's repeated moves say of the floor; nothing where none repeats."""
    lines = []
    for axis, signals in found.repeats.items():
        parts = [f"{signal} {check.ratio:.1f} x" for signal, check in signals.items()]
        moves = next(iter(signals.values())).moves
        lines.append(
            f"{axis}: {moves} moves repeat another; they scatter by {', '.join(parts)} "
            "what the machine file's repeatability gives"
        )
    return lines


def machine_of(machine: Path | None, *recorded: Recording) -> Machine:
    """The machine file named, or the one that the recordings carry.

    Raises:
        UnusableInput: recordings that were made with different machine files.
        ConfigError: the machine file cannot be used.
    """
    from stagectl.config.machine_file import load_machine, parse_machine
    from stagectl.errors import UnusableInput

    if machine is not None:
        return load_machine(machine)
    first = recorded[0]
    for other in recorded[1:]:
        if other.machine != first.machine:
            raise UnusableInput(
                f"{other.source}: made with another machine file than {first.source}; "
                "say with --machine which one counts"
            )
    return parse_machine(first.machine, f"{first.source}:machine")


def _measured(
    recorded: Recording, settings: StageSettings, progress: Callable[[int, int], object]
) -> Measured:
    from sim2real.gap import compare_with_model
    from stagectl.errors import UnusableInput

    try:
        return compare_with_model(recorded, settings, progress=progress)
    except ValueError as error:
        raise UnusableInput(f"{recorded.source}: {error}") from error


def console_for(quiet: bool) -> Console:
    """Where people read: standard error where the JSON goes to standard output."""
    from rich.console import Console

    return Console(stderr=quiet)


@contextmanager
def _simulating(console: Console) -> Iterator[Callable[[int, int], object]]:
    from rich.progress import Progress

    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("simulating", total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)


def gap_table(found: Mapping[str, Mapping[str, GapFigures]], title: str, *names: str) -> Any:
    """Gaps and floors, in the units people read; `explained` where there is one."""
    from rich.table import Table

    both = any(f.explained is not None for signals in found.values() for f in signals.values())
    table = Table(title=title, title_justify="left")
    gaps = (names or ("gap", "explained"))[: 2 if both else 1]
    for name in ("axis", "signal", *gaps, "floor", *(f"{gap} / floor" for gap in gaps)):
        table.add_column(name, justify="left" if name in ("axis", "signal") else "right")
    for axis, signals in found.items():
        for signal, gap in signals.items():
            scale, unit = (1e6, "µm") if signal == "position" else (1.0, "N")
            values = [gap.nominal, *([] if gap.explained is None else [gap.explained])]
            table.add_row(
                axis,
                signal,
                *(f"{value * scale:.3f} {unit}" for value in (*values, gap.floor)),
                *(f"{value / gap.floor:.1f}" if gap.floor > 0 else "-" for value in values),
            )
    return table
