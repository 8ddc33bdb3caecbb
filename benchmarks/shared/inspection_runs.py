"""Whole runs of the recipe inspection-20 on the virtual stage."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from stagectl.config.machine import Machine
from stagectl.errors import RunFault
from stagectl.measurement import Measurement, measure_virtual_stage
from stagectl.recipe import Recipe
from stagectl.run import HostSettings, Listener, RunRequest, RunResult, SimulatedStage, execute
from stagectl.sequencer import Mode

RECIPE = Path(__file__).parents[2] / "recipes" / "inspection-20.yaml"
FIRST_SITE = 4
"""Before it, friction is still being learned."""


@dataclass(frozen=True, slots=True)
class Case:
    """One row.

    Attributes:
        label: first column.
        mode: of compensation.
        friction_scale: of the figures that the host starts from.
        first_site: moves to earlier sites are left out.
        observer: corrects the force offsets at every SYNC.
        measured: stage on which its measurement was made; None: the true one.
    """

    label: str
    mode: Mode
    friction_scale: float = 1.0
    first_site: int = 1
    observer: bool = False
    measured: Machine | None = None


def measured(machine: Machine, stage: Machine) -> Measurement | None:
    """The measurement of a virtual stage; None where it cannot be measured."""
    try:
        return measure_virtual_stage(machine, stage)
    except RunFault:
        return None


def run(
    case: Case, recipe: Recipe, machine: Machine, seed: int, truth: Machine | None = None
) -> dict[str, Any]:
    """The summary of one run; `truth` is the stage as it is, if not as the machine file says."""
    return run_whole(case, recipe, machine, seed, truth).summary


def run_whole(
    case: Case, recipe: Recipe, machine: Machine, seed: int, truth: Machine | None = None
) -> RunResult:
    """One run, its recording included; arguments as of `run`."""
    with tempfile.TemporaryDirectory() as folder:
        request = RunRequest(
            recipe,
            machine,
            Path(folder),
            datetime.now(UTC),
            simulated=SimulatedStage(truth or machine, seed),
            host=HostSettings(
                mode=case.mode,
                friction_scale=case.friction_scale,
                observer=case.observer,
                measurement=measured(machine, case.measured or truth or machine)
                if case.observer
                else None,
            ),
        )
        result = execute(request, Listener())
    if result.error is not None:
        raise result.error
    return result
