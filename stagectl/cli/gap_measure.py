"""`stagectl gap measure`: the gap of a machine file, without any fit."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from stagectl.cli.console import ProgressUpdate, console_for, progress_bar, show_result
from stagectl.cli.options import FILE, JSON_OUT, RECORDING
from stagectl.errors import UnusableInput, unusable

if TYPE_CHECKING:
    from hil_sim.settings import StageSettings
    from sim2real.gap import GapMeter
    from stagectl.config import Machine
    from stagectl.store import RecordingBlocks
    from stagedata import Recording


@click.command("measure")
@click.argument("recording", type=RECORDING)
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
    from sim2real.findings import FORMAT, VERSION, gap_json
    from stagectl.config import stage_settings
    from stagectl.report import print_sections
    from stagectl.report.gap import gap_section, repeat_lines
    from stagectl.store import RecordingBlocks

    recorded = RecordingBlocks(recording)
    model = machine_of(machine, recorded)
    with progress_bar(console_for(json_out), "simulating") as update:
        found = measured_gap(recorded, stage_settings(model), update)
    gap = found.gap()
    report = {"format": FORMAT, "version": VERSION, "recordings": [str(recording)]}
    title = f"Gap of {model.name} against {recording.name} (rms)"
    section = gap_section(gap, title, repeats=repeat_lines([found.repeats()]))
    show_result({**report, "gap": gap_json(gap)}, json_out, print_sections([section]))


def machine_of(
    machine: Path | None, *recorded: Recording | RecordingBlocks, fitted: bool = False
) -> Machine:
    """The machine file named, or the one inside the recordings.

    Args:
        machine: its path, None for the recordings' own.
        recorded: at least one.
        fitted: whether what it leaves unknown will be found.

    Raises:
        UnusableInput: the recordings were made with different machine files.
        ConfigError: the machine file cannot be used.
    """
    from stagectl.config import load_machine, parse_machine

    if machine is not None:
        return load_machine(machine, fitted=fitted)
    first = recorded[0]
    for other in recorded[1:]:
        if other.machine != first.machine:
            raise UnusableInput(
                f"{other.source}: made with another machine file than {first.source}; "
                "choose one with --machine"
            )
    return parse_machine(first.machine, f"{first.source}:machine", fitted=fitted)


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
