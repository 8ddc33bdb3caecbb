"""`stagectl gap measure`: the gap of a machine file, without any fit."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from stagectl.cli.options import FILE, JSON_OUT, RECORDING
from stagectl.cli.terminal import ProgressUpdate, console_for, progress_bar, show_result
from stagectl.diagnosis import machine_of
from stagectl.errors import unusable

if TYPE_CHECKING:
    from hil_sim.settings import StageSettings
    from sim2real.gap import Gap, GapMeter
    from stagectl.config import Machine
    from stagectl.store import RecordingBlocks


@click.command("measure")
@click.argument("recording", type=RECORDING)
@click.option(
    "--machine", type=FILE, help="Machine file to simulate.  [default: the recording's own]"
)
@JSON_OUT
def measure(recording: Path, machine: Path | None, json_out: Path | None) -> None:
    """Simulate the setpoints of RECORDING in closed loop and compare; nothing is fitted.

    Without a demand, or with unknown gains, forces are compared along the measured motion.

    The gap is the rms of recorded minus simulated (noise-free) position and force. The floor is
    what a perfect model would still leave: encoder noise and the friction repeatability stated in
    the machine file. Moves that the recording repeats serve as a check of the floor.
    """
    from sim2real.findings import FORMAT, VERSION, gap_json
    from stagectl.config import stage_settings
    from stagectl.report import print_sections
    from stagectl.report.gap import gap_section, repeat_lines
    from stagectl.store import RecordingBlocks

    recorded = RecordingBlocks(recording)
    model = machine_of(machine, recorded, gains=False)
    if reason := why_along_motion([recorded], [model]):
        gap = gap_along_motion(recorded, stage_settings(model))
        facts = [f"{reason}: forces along the measured motion."]
    else:
        with progress_bar(console_for(json_out), "simulating") as update:
            found = measured_gap(recorded, stage_settings(model), update)
        gap, facts = found.gap(), repeat_lines([found.repeats()])
    report = {"format": FORMAT, "version": VERSION, "recordings": [str(recording)]}
    title = f"Gap of {model.name} against {recording.name} (rms)"
    section = gap_section(gap, title, repeats=facts)
    show_result({**report, "gap": gap_json(gap)}, json_out, print_sections([section]))


def why_along_motion(
    recorded: Sequence[RecordingBlocks], machines: Sequence[Machine]
) -> str | None:
    """Why forces have to be compared along the measured motion; None where the loop is simulated.

    Args:
        recorded: in which an axis may have no demand.
        machines: which may leave gains unknown.
    """
    from sim2real.diagnosis.examination import why_open_loop

    first = [next(iter(blocks)) for blocks in recorded]
    reasons = (why_open_loop(first, machine.unknown) for machine in machines)
    return next((reason for reason in reasons if reason), None)


def gap_along_motion(recorded: RecordingBlocks, settings: StageSettings) -> Gap:
    """The gap in force of a stage's settings along the motion of a recording.

    Raises:
        UnusableInput: the recording does not fit them.
    """
    from sim2real.audit import repair_samples
    from sim2real.open_loop import compare_along, measure_motion
    from stagectl.store import read_recording

    repaired, _ = repair_samples(read_recording(recorded.source), settings)
    with unusable(ValueError, about=f"{recorded.source}: "):
        return compare_along(measure_motion(repaired, settings), settings).gap


def measured_gap(
    recorded: RecordingBlocks, settings: StageSettings, update: ProgressUpdate
) -> GapMeter:
    """The gap of a stage's settings on a recording.

    Raises:
        UnusableInput: the recording does not fit them.
    """
    from functools import partial

    from sim2real.audit import repair_samples
    from sim2real.gap import DRAWS, GapMeter

    meter = GapMeter(settings, DRAWS, partial(update, "simulating"), len(recorded))
    with unusable(ValueError, about=f"{recorded.source}: "):
        for block in recorded:
            meter.add(repair_samples(block, settings)[0])
    return meter
