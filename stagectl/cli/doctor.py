"""`stagectl doctor`: what this machine offers a stage, and what it lacks."""

from __future__ import annotations

import logging
import platform
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from stagectl.cli.options import JSON_OUT, NumberRange
from stagectl.cli.terminal import make_table, show_result
from stagectl.doctor import NAMES, Finding, examine
from stagectl.errors import StagectlError

if TYPE_CHECKING:
    from rich.table import Table


@click.command
@click.option("--require", type=click.Choice(NAMES), multiple=True,
              help="Exit with 1 if this machine lacks it; repeat for several.")  # fmt: skip
@click.option("--seconds", type=NumberRange(0.1, 60), default=2.0,
              help="Measure jitter for this long [s].")  # fmt: skip
@JSON_OUT
def command(require: tuple[str, ...], seconds: float, json_out: Path | None) -> None:
    """Report what this machine offers a stage, what it lacks, and how to get it.

    Compiled kernels, real-time scheduling, jitter at a SYNC period of 1 ms, SocketCAN, SYNC by the
    kernel, virtual CAN, UDP multicast, other adapters, PostgreSQL. A simulation needs none of them.
    Nothing is changed, and no frame is sent on a CAN bus.

    \b
    Before commissioning on SocketCAN:
      stagectl doctor --require socketcan --require real-time --require jitter

    Exit code 0, or 1 if something required is missing.
    """  # noqa: D301  (\b keeps click from wrapping what follows)
    logging.getLogger("can").setLevel(logging.CRITICAL)  # of every driver that is not installed
    findings = list(examine(seconds))
    show_result(_as_json(findings), json_out, _table(findings))
    lacking = [one.name for one in findings if one.name in require and not one.available]
    if lacking:
        raise StagectlError(f"this machine lacks {', '.join(lacking)}")


def _as_json(findings: list[Finding]) -> dict[str, Any]:
    return {
        "python": platform.python_version(),
        "kernel": platform.release(),
        "machine": platform.machine(),
        "findings": [{**asdict(one), "remedy": one.remedy or None} for one in findings],
    }


def _table(findings: list[Finding]) -> Table:
    title = (
        f"Python {platform.python_version()}, {platform.system()} {platform.release()}, "
        f"{platform.machine()}"
    )
    rows = [
        (f.name, "yes" if f.available else "no", f.found + (f"\n→ {f.remedy}" if f.remedy else ""))
        for f in findings
    ]
    titles = ("part", "ready", "found, and how to get what is missing")
    return make_table(title, titles, rows, show_lines=True)
