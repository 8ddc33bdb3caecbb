"""`stagectl gap`: where simulation and recording differ, and why."""

from __future__ import annotations

import click

from stagectl.cli.lazy import LazyGroup

COMMANDS = {
    "measure": ("stagectl.cli.gap_measure:measure", "The gap of a machine file and its floor."),
    "compare": ("stagectl.cli.gap_measure:compare", "Two machine files, the same recordings."),
    "diagnose": ("stagectl.cli.gap_diagnose:diagnose", "Where the gap lies, what causes it."),
    "blind": ("stagectl.cli.gap_blind:blind", "The diagnosis checked on sealed effects."),
    "import": ("stagectl.cli.gap_import:import_data", "Foreign data (.mat, .csv) as a recording."),
}


@click.group(cls=LazyGroup, lazy=COMMANDS, short_help="Where simulation and recording differ.")
def command() -> None:
    """The gap between a machine file's simulation and what a stage recorded."""
