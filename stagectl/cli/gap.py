"""`stagectl gap`: where simulation and recording differ."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from stagectl.cli.options import FILE, write_json

if TYPE_CHECKING:
    from sim2real.gap import Gap

FORMAT, VERSION = "stagectl-gap-report", 1


@click.group(short_help="Where simulation and recording differ.")
def command() -> None:
    """The gap between a machine file's simulation and what a stage recorded."""


@command.command("measure", short_help="The gap of a machine file against a recording.")
@click.argument("recording", type=FILE)
@click.option("--machine", type=FILE, help="Machine file to compare [the recording's own].")
@click.option("--json", "json_out", type=FILE, help="Write the figures here; - is stdout.")
def measure(recording: Path, machine: Path | None, json_out: Path | None) -> None:
    """Simulate RECORDING's demands in closed loop and compare; nothing is fitted.

    The gap is the rms of recorded minus simulated, noise-free. The floor is what a perfect model
    would still show, for encoder noise and the repeatability that the machine file states.
    """
    from rich.console import Console
    from rich.progress import Progress

    from sim2real import gap as sim2real_gap
    from stagectl.config.machine import load_machine, parse_machine
    from stagectl.config.mapping import stage_settings
    from stagectl.errors import UnusableInput
    from stagectl.store.recording import read_recording

    recorded = read_recording(recording)
    model = (
        parse_machine(recorded.machine, f"{recording}:machine")
        if machine is None
        else load_machine(machine)
    )
    quiet = json_out is not None and str(json_out) == "-"
    console = Console(stderr=quiet)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("simulating", total=None)
        try:
            found = sim2real_gap.measure(
                recorded,
                stage_settings(model),
                progress=lambda done, total: bar.update(task, completed=done, total=total),
            )
        except ValueError as error:
            raise UnusableInput(f"{recording}: {error}") from error
    if json_out is not None:
        write_json(_report(found, recording), json_out)
    if not quiet:
        console.print(_table(found, model.name, recording))


def _report(found: Gap, recording: Path) -> dict[str, Any]:
    """docs/formats/gap-report.md, as far as `measure` fills it."""
    return {
        "format": FORMAT,
        "version": VERSION,
        "recordings": [str(recording)],
        "gap": {
            axis: {
                signal: {"nominal": gap.nominal, "floor": gap.floor, "unit": gap.unit}
                for signal, gap in signals.items()
            }
            for axis, signals in found.items()
        },
    }


def _table(found: Gap, machine: str, recording: Path) -> Any:
    from rich.table import Table

    table = Table(title=f"Gap of {machine} against {recording.name} (rms)", title_justify="left")
    for name in ("axis", "signal", "gap", "floor", "gap / floor"):
        table.add_column(name, justify="left" if name in ("axis", "signal") else "right")
    for axis, signals in found.items():
        for signal, gap in signals.items():
            scale, unit = (1e6, "µm") if signal == "position" else (1.0, "N")
            ratio = f"{gap.nominal / gap.floor:.1f}" if gap.floor > 0 else "-"
            table.add_row(
                axis, signal, f"{gap.nominal * scale:.3f} {unit}",
                f"{gap.floor * scale:.3f} {unit}", ratio,
            )  # fmt: skip
    return table
