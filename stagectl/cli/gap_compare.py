"""`stagectl gap compare`: which of two machine files is closer to the same recordings."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from stagectl.cli.gap_measure import (
    gap_along_motion,
    measured_gap,
    why_along_motion,
)
from stagectl.cli.options import JSON_OUT, RECORDING
from stagectl.cli.terminal import console_for, progress_bar, show_result
from stagectl.diagnosis import machine_of

if TYPE_CHECKING:
    from sim2real.gap import Gap
    from stagectl.config import Machine
    from stagectl.report import Section
    from stagectl.sequencer import MoveStatistics
    from stagectl.store import RecordingBlocks

_HDF5 = b"\x89HDF\r\n\x1a\n"
_KINDS = ("macro", "micro")

Settling = dict[str, dict[str, "MoveStatistics"]]
"""Recording -> kind of move -> statistics."""


@click.command("compare")
@click.argument("first", type=RECORDING, metavar="A")
@click.argument("second", type=RECORDING, metavar="B")
@click.argument("recordings", type=RECORDING, nargs=-1, metavar="[REC.h5]...")
@JSON_OUT
def compare(first: Path, second: Path, recordings: tuple[Path, ...], json_out: Path | None) -> None:
    """Compare two machine files on the same recordings: which one is closer, and by how much.

    A and B are machine files, or two recordings or folders of runs: then the machine files are
    those inside, and both are the recordings compared on. Nothing is fitted. Gap closed is the
    share of A's gap above its floor that B removes. How the moves of each recording settled stands
    beside it.

    \b
    Which machine file is closer?
      stagectl gap compare MACHINE.yaml TWIN.yaml REC.h5
    What did the twin change, from one run to the next?
      stagectl gap compare runs/BEFORE runs/AFTER
    """  # noqa: D301  (\b keeps click from wrapping what follows)
    from sim2real.findings import FORMAT, VERSION, gap_json
    from sim2real.gap import gap_closed, pool_gaps
    from stagectl.config import stage_settings
    from stagectl.report import print_sections
    from stagectl.report.gap import gap_section
    from stagectl.store import RecordingBlocks

    paths = recordings or tuple(path for path in (first, second) if _is_recording(path))
    if not paths or (not recordings and len(paths) < 2):
        raise click.UsageError(
            "name at least one recording on which to compare the two machine files"
        )
    machines = [_machine_of(path) for path in (first, second)]
    settings = [stage_settings(machine) for machine in machines]
    recorded = {str(path): RecordingBlocks(path) for path in paths}
    console = console_for(json_out)
    reason = why_along_motion(list(recorded.values()), machines)
    gaps: list[list[tuple[Gap, int]]] = [[], []]
    with progress_bar(console, "simulating") as update:
        for found, model in zip(gaps, settings, strict=True):
            for r in recorded.values():
                own = gap_along_motion(r, model) if reason else measured_gap(r, model, update).gap()
                found.append((own, r.samples))
    before, after = map(pool_gaps, gaps)
    share = gap_closed(before, after)
    settled = _settling(recorded, settings[0].control_period, settings[0].sync_period)
    both: Gap = {
        axis: {
            signal: replace(figures, explained=after[axis][signal].nominal)
            for signal, figures in signals.items()
        }
        for axis, signals in before.items()
    }
    report = {
        "format": FORMAT,
        "version": VERSION,
        "recordings": list(recorded),
        "machines": [str(first), str(second)],
        "gap": gap_json(both),
        "gap_closed": share,
        "settling": _settling_json(settled),
    }
    title = f"Gap of {_name(first)} (A) and {_name(second)} (B) (rms)"
    how = [f"{reason}: forces along the measured motion."] if reason else []
    gap = gap_section(both, title, "A", "B", repeats=[closed_line(share), *how])
    show_result(report, json_out, print_sections([gap, _settling_section(settled)]))


def closed_line(share: float | None) -> str:
    """The share of the gap closed, as a sentence."""
    from stagectl.report.formats import percent

    if share is None:
        return "Gap closed cannot be stated: A's gap is too close to its floor, or too large."
    if share < 0:
        return f"B is farther from the recordings than A (gap closed: {share:.2f})."
    return f"B closes {percent(share)} of A's gap."


def _is_recording(path: Path) -> bool:
    """Whether it begins like an HDF5 file."""
    try:
        with path.open("rb") as file:
            return file.read(len(_HDF5)) == _HDF5
    except OSError:
        return False


def _machine_of(path: Path) -> Machine:
    """The machine file, or the one inside a recording."""
    from stagectl.store import RecordingBlocks

    recorded = [RecordingBlocks(path)] if _is_recording(path) else []
    return machine_of(None if recorded else path, *recorded, gains=False)


def _name(path: Path) -> str:
    """File name; of a run's recording with its folder, for all have the same name."""
    return f"{path.parent.name}/{path.name}" if _is_recording(path) else path.name


def _settling(
    recorded: dict[str, RecordingBlocks], control_period: float, sync_period: float
) -> Settling:
    """Statistics of the recordings' macro- and micro-moves; without those that have none."""
    from stagectl.sequencer import statistics, summarise_moves

    found: Settling = {}
    for path, recording in recorded.items():
        results = [
            result
            for block in recording
            for result in summarise_moves(block, control_period, sync_period)
        ]
        kinds = {kind: statistics(results, kind) for kind in _KINDS}
        kinds = {kind: moves for kind, moves in kinds.items() if moves.count}
        if kinds:
            found[path] = kinds
    return found


def _settling_json(settled: Settling) -> dict[str, Any]:
    """As the blocks `micro` and `macro` of a run's summary."""
    from stagectl.store.summary import statistics_block

    return {
        path: {kind: statistics_block(block) for kind, block in blocks.items()}
        for path, blocks in settled.items()
    }


def _settling_section(settled: Settling) -> Section:
    """Settling time of each recording's moves in ms, mean and 90th percentile per window."""
    from stagectl.report import Section, Table

    windows = sorted({w for of in settled.values() for b in of.values() for w in b.settling_mean})
    titles = ["recording", "move", "moves", *(f"±{window * 1e9:g} nm" for window in windows)]
    rows = []
    for path, blocks in settled.items():
        for kind, block in blocks.items():
            times = [
                f"{block.settling_mean[w] * 1e3:.1f}, {block.settling_p90[w] * 1e3:.1f}"
                for w in windows
            ]
            rows.append((_name(Path(path)), kind, str(block.count), *times))
    title = "Settling (mean, 90th percentile), ms"
    return Section(title, table=Table(titles, rows))
