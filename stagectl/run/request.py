"""A run as it is asked for, and how it went: plain values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from hil_sim.bus import FaultPlan
from stagectl.config.machine import Machine
from stagectl.errors import StagectlError
from stagectl.recipe import Recipe
from stagectl.sequencer import Figures, Mode, SiteVerdict
from stagedata import Recording


@dataclass(frozen=True, slots=True)
class Resumed:
    """An interrupted run that is gone on with.

    Attributes:
        run: its folder.
        started: when it began, ISO 8601.
        done: stretches of the recipe (sites, or entries of a list of moves) that are over.
        friction: axis -> figures accepted last.
    """

    run: str
    started: str
    done: int
    friction: Mapping[str, Figures]

    @classmethod
    def noted(cls, note: Mapping[str, Any]) -> Resumed:
        """From what a recording keeps of it (`RunRequest.as_noted`)."""
        friction = {
            str(axis): {str(name): (float(p[0]), float(p[1])) for name, p in figures.items()}
            for axis, figures in note["friction"].items()
        }
        return cls(str(note["run"]), str(note["started"]), int(note["done"]), friction)

    def link(self) -> dict[str, object]:
        """For the summary of the run that goes on: what it goes on with, and where."""
        return {"run": self.run, "started": self.started, "done": self.done}


@dataclass(frozen=True, slots=True)
class RunRequest:
    """What is to be run.

    Attributes:
        recipe: checked against `machine`.
        machine: what the host believes.
        truth: what the virtual stage is; None for the machine's bus.
        bus: (interface, channel) instead of the machine's.
        mode: of compensation.
        friction_scale: of the friction figures the host starts from.
        seed: of the virtual stage's noise and repeatability.
        folder: for the files.
        started: time of the run, with zone.
        faults: of bus and drives, on the virtual stage only; None for none.
        retries: how often a stretch (a site) is begun again after a fault that can be recovered.
        resumed: the interrupted run that this one goes on with; None: from the start.
        history: file or server that the friction estimates go to; None for none.
        use_map: go by the history's active friction map, where there is one.
    """

    recipe: Recipe
    machine: Machine
    truth: Machine | None
    bus: tuple[str, str] | None
    mode: Mode
    friction_scale: float
    seed: int
    folder: Path
    started: datetime
    faults: FaultPlan | None = None
    retries: int = 0
    resumed: Resumed | None = None
    history: str | None = None
    use_map: bool = True

    def as_noted(self) -> dict[str, Any]:
        """What the recording keeps of it, for a run that goes on with this one and for replay."""
        resumed = self.resumed
        return {
            "compensation": self.mode.value,
            "friction_scale": self.friction_scale,
            "seed": self.seed,
            "simulated": self.truth is not None,
            "truth": None
            if self.truth is None or self.mode is not Mode.ORACLE
            else self.truth.text,
            "bus": None if self.bus is None else list(self.bus),
            "files": {
                "recipe": self.recipe.source,
                "machine": self.machine.source,
                "truth": None if self.truth is None else self.truth.source,
            },
            "retries": self.retries,
            "calibration": bool(self.recipe.excursions),
            "sites": [list(site) for site in self.recipe.sites] if self.recipe.excursions else None,
            "slipped": len(self.recipe.slipped),
            "resumed": None
            if resumed is None
            else {**resumed.link(), "friction": {k: dict(v) for k, v in resumed.friction.items()}},
        }


@dataclass(frozen=True, slots=True)
class RunResult:
    """How it went.

    Attributes:
        summary: as in `summary.json`.
        recording: of the run, None when it ended before its first sample.
        error: what ended it early, else None.
        first_update: axis -> index of the recording's move after whose update its friction model
            was first learned; absent where it never was.
        verdicts: pass or fail per site, where the recipe has limits.
        notices: what else the operator should know.
        unwritten: what the friction history has not of the run, why, and how it gets it; None
            where it has all. A notice, too.
    """

    summary: dict[str, Any]
    recording: Recording | None
    error: StagectlError | None
    first_update: dict[str, int]
    verdicts: tuple[SiteVerdict, ...]
    notices: tuple[str, ...] = ()
    unwritten: str | None = None
