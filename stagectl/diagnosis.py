"""A diagnosis of recordings by a machine file, as `gap diagnose` and fleets make it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from stagectl.errors import UnusableInput, unusable

if TYPE_CHECKING:
    from sim2real.diagnosis import Diagnosis, Examination
    from stagectl.config import Machine
    from stagectl.store import RecordingBlocks
    from stagedata import Recording


@dataclass(frozen=True, slots=True, eq=False)
class Diagnosed:
    """Recordings and what was found.

    Attributes:
        examined: the recordings with their gap.
        found: its diagnosis.
        left_out: why the other recordings did not judge it; None where they did, or there are none.
    """

    examined: Examination
    found: Diagnosis
    left_out: str | None


def machine_of(
    machine: Path | None,
    *recorded: Recording | RecordingBlocks,
    fitted: bool = False,
    gains: bool = True,
) -> Machine:
    """The machine file named, or the one inside the recordings.

    Args:
        machine: its path, None for the recordings' own.
        recorded: at least one.
        fitted: whether what it leaves unknown will be found.
        gains: whether the controller's gains are needed.

    Raises:
        UnusableInput: the recordings were made with different machine files.
        ConfigError: the machine file cannot be used.
    """
    from stagectl.config import load_machine, parse_machine

    if machine is not None:
        return load_machine(machine, fitted=fitted, gains=gains)
    first = recorded[0]
    for other in recorded[1:]:
        if other.machine != first.machine:
            raise UnusableInput(
                f"{other.source}: made with another machine file than {first.source}; "
                "choose one with --machine"
            )
    return parse_machine(first.machine, f"{first.source}:machine", fitted=fitted, gains=gains)


def diagnose_recordings(
    recorded: Sequence[Recording],
    machine: Machine,
    *,
    others: Sequence[Recording] = (),
    jobs: int = 1,
    correct: bool = False,
    progress: Callable[[str, int, int], object] = lambda *_: None,
) -> Diagnosed:
    """Diagnose recordings of one stage together.

    Args:
        recorded: at least one.
        machine: file to examine.
        others: recordings that only judge what was found.
        jobs: threads to fit with.
        correct: continue with corrected channels where some are faulty.
        progress: called with what is being done, steps done and their number.

    Raises:
        UnusableInput: a recording does not fit the machine file, or effects cannot be loaded.
    """
    from hil_sim.effects.library import EffectError, library
    from sim2real import diagnosis
    from stagectl.config import stage_settings

    settings = stage_settings(machine)
    tolerance = {name: axis.plant.tolerance for name, axis in machine.axes.items()}
    with unusable(EffectError, about="effects: "):
        effects = library()
    with unusable(ValueError):
        examined = diagnosis.examine(
            recorded, settings, correct=correct, unknown=machine.unknown, progress=progress
        )
        judges: Examination | None = None
        left_out: str | None = None
        if others and examined.insufficient is None:
            clock = diagnosis.continue_clock(recorded, others)
            judges = diagnosis.examine_others(
                examined, others, settings, correct=correct, clock=clock
            )
        if judges is not None and judges.insufficient is not None:
            left_out = judges.insufficient
            judges = None
        found = diagnosis.diagnose(examined, tolerance, effects, jobs=jobs, progress=progress)
        if judges is not None:
            found = replace(found, report=diagnosis.judge_elsewhere(found, judges))
    return Diagnosed(examined, found, left_out)
