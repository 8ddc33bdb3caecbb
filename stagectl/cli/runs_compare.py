"""`stagectl runs compare`: two runs beside each other."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from stagectl.cli.console import make_console
from stagectl.cli.files import InputFolder


@click.command("compare")
@click.argument("first", type=InputFolder(), metavar="A")
@click.argument("second", type=InputFolder(), metavar="B")
def compare(first: Path, second: Path) -> None:
    """Compare two runs, such as those of two wafers: settling, peak errors, friction, limits.

    A and B are folders of runs. Values are those of their reports: medians of the moves of each
    axis and kind, and the friction figures accepted last.
    """
    from stagectl.report import compare_runs, print_sections

    section = compare_runs(_summary(first), _summary(second), (first.name, second.name))
    make_console().print(print_sections([section]), crop=False)


def _summary(folder: Path) -> Mapping[str, Any]:
    """A run's summary.

    Raises:
        UnusableInput: there is none.
    """
    from stagectl.errors import UnusableInput

    path = folder / "summary.json"
    try:
        summary: Mapping[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise UnusableInput(f"{path}: no summary of a run ({error})") from None
    if summary.get("format") != "stagectl-run-summary":
        raise UnusableInput(f"{path}: no summary of a run")
    return summary
