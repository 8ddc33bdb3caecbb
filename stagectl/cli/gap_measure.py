"""`stagectl gap measure` and `compare`: the gap of machine files, without any fit."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from stagectl.cli.console import ProgressUpdate, console_for, progress_bar
from stagectl.cli.options import FILE, JSON_OUT, is_json_on_stdout, write_json

if TYPE_CHECKING:
    from hil_sim.settings import StageSettings
    from sim2real.gap import Gap, Measured
    from sim2real.report import GapFigures
    from stagectl.config import Machine
    from stagedata import Recording


@click.command("measure")
@click.argument("recording", type=FILE)
@click.option(
    "--machine", type=FILE, help="Machine file to simulate.  [default: the recording's own]"
)
@JSON_OUT
def measure(recording: Path, machine: Path | None, json_out: Path | None) -> None:
    """Simulate the setpoints of RECORDING in closed loop and compare; nothing is fitted.

    The gap is the rms of recorded minus simulated (noise-free) position and force. The floor is
    what a perfect model would still leave: encoder noise and the friction repeatability stated in
    the machine file. Moves that the recording repeats serve as a check of the floor.
    """
    from sim2real.report import FORMAT, VERSION, gap_json
    from stagectl.config import stage_settings
    from stagectl.store import read_recording

    recorded = read_recording(recording)
    model = machine_of(machine, recorded)
    console = console_for(json_out)
    with progress_bar(console, "simulating") as update:
        found = _measure(recorded, stage_settings(model), update)
    if json_out is not None:
        report = {"format": FORMAT, "version": VERSION, "recordings": [str(recording)]}
        write_json({**report, "gap": gap_json(found.gap)}, json_out)
    if not is_json_on_stdout(json_out):
        console.print(gap_table(found.gap, f"Gap of {model.name} against {recording.name} (rms)"))
        for line in repeat_lines(found):
            console.print(line, markup=False, highlight=False)


@click.command("compare")
@click.argument("first", type=FILE, metavar="A.yaml")
@click.argument("second", type=FILE, metavar="B.yaml")
@click.argument("recordings", type=FILE, nargs=-1, required=True, metavar="REC.h5...")
@JSON_OUT
def compare(first: Path, second: Path, recordings: tuple[Path, ...], json_out: Path | None) -> None:
    """Compare two machine files on the same recordings: which one is closer, and by how much.

    Nothing is fitted. Gap closed is the share of A's gap above its floor that B removes.
    """
    from sim2real.gap import gap_closed, pool_gaps
    from sim2real.report import FORMAT, VERSION, GapFigures, gap_json
    from stagectl.config import load_machine, stage_settings
    from stagectl.store import read_recording

    settings = [stage_settings(load_machine(path)) for path in (first, second)]
    recorded = [read_recording(path) for path in recordings]
    console = console_for(json_out)
    gaps = []
    with progress_bar(console, "simulating") as update:
        for model in settings:
            each = [(_measure(r, model, update).gap, len(r)) for r in recorded]
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
    if not is_json_on_stdout(json_out):
        console.print(
            gap_table(both, f"Gap of {first.name} (A) and {second.name} (B) (rms)", "A", "B")
        )
        console.print(closed_line(share), markup=False, highlight=False)


def closed_line(share: float | None) -> str:
    """The share of the gap closed, as a sentence."""
    if share is None:
        return "No share of the gap can be stated: A is too close to its floor, or too far off."
    if share < 0:
        return f"B is farther from the recordings than A (gap closed: {share:.2f})."
    return f"B closes {100 * share:.0f} % of A's gap."


def repeat_lines(found: Measured) -> list[str]:
    """The scatter of repeated moves compared with the floor, one line per axis that has any."""
    lines = []
    for axis, signals in found.repeats.items():
        parts = [f"{signal} {check.ratio:.1f} x" for signal, check in signals.items()]
        moves = next(iter(signals.values())).moves
        lines.append(
            f"{axis}: {moves} repeated moves scatter by {', '.join(parts)} "
            "what the machine file's repeatability predicts"
        )
    return lines


def machine_of(machine: Path | None, *recorded: Recording) -> Machine:
    """The machine file named, or the one inside the recordings.

    Raises:
        UnusableInput: the recordings were made with different machine files.
        ConfigError: the machine file cannot be used.
    """
    from stagectl.config import load_machine, parse_machine
    from stagectl.errors import UnusableInput

    if machine is not None:
        return load_machine(machine)
    first = recorded[0]
    for other in recorded[1:]:
        if other.machine != first.machine:
            raise UnusableInput(
                f"{other.source}: made with another machine file than {first.source}; "
                "choose one with --machine"
            )
    return parse_machine(first.machine, f"{first.source}:machine")


def _measure(recorded: Recording, settings: StageSettings, update: ProgressUpdate) -> Measured:
    from functools import partial

    from sim2real.audit import repair_samples
    from sim2real.gap import compare_with_model
    from stagectl.errors import UnusableInput

    try:
        repaired, _ = repair_samples(recorded, settings)
        return compare_with_model(repaired, settings, progress=partial(update, "simulating"))
    except ValueError as error:
        raise UnusableInput(f"{recorded.source}: {error}") from error


def gap_table(found: Mapping[str, Mapping[str, GapFigures]], title: str, *names: str) -> Any:
    """Gaps and floors in µm and N.

    Args:
        found: axis -> signal -> figures.
        title: of the table.
        names: of the columns of `nominal` and `explained`; "gap" and "explained" by default.
    """
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
