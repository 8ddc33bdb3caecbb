"""What to run, and the result: plain values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stagectl.config.machine import Machine
from stagectl.errors import StagectlError
from stagectl.recipe import Recipe, count_segments
from stagectl.sequencer.compensation.mode import Figures, Mode

if TYPE_CHECKING:
    from hil_sim.bus import FaultPlan
    from stagectl.measurement import Measurement
    from stagectl.sequencer import SiteVerdict
    from stagedata import Recording


@dataclass(frozen=True, slots=True)
class Remarks:
    """What the operator says of a run: name and comment, one line each, or None."""

    operator: str | None = None
    comment: str | None = None

    def or_of(self, resumed: Resumed | None) -> Remarks:
        """These, and where they say nothing those of the run that is continued."""
        if resumed is None:
            return self
        before = resumed.remarks
        return Remarks(self.operator or before.operator, self.comment or before.comment)


@dataclass(frozen=True, slots=True)
class Resumed:
    """An interrupted run to be continued.

    Attributes:
        run: its folder.
        started: when it began, ISO 8601.
        done: completed segments of the recipe (sites, or entries of a list of moves).
        friction: axis -> figures accepted last.
        verdicts: of the completed sites, where the recipe has limits.
        remarks: on it, which the continuation keeps unless it is given others.
    """

    run: str
    started: str
    done: int
    friction: Mapping[str, Figures]
    verdicts: tuple[SiteVerdict, ...] = ()
    remarks: Remarks = Remarks()

    @classmethod
    def from_note(cls, note: Mapping[str, Any]) -> Resumed:
        """From the note in a recording (`RunRequest.as_note`)."""
        from stagectl.sequencer import SiteVerdict

        friction = {
            str(axis): {str(name): (float(p[0]), float(p[1])) for name, p in figures.items()}
            for axis, figures in note["friction"].items()
        }
        verdicts = tuple(
            SiteVerdict(int(site), tuple(map(str, failures)))
            for site, failures in note.get("verdicts", ())
        )
        return cls(str(note["run"]), str(note["started"]), int(note["done"]), friction, verdicts)

    def as_note(self) -> dict[str, Any]:
        """For the recording of the run that continues it."""
        return {
            **self.link(),
            "friction": {axis: dict(figures) for axis, figures in self.friction.items()},
            "verdicts": [[v.site, list(v.failures)] for v in self.verdicts],
        }

    def link(self) -> dict[str, object]:
        """For the summary of the run that continues it."""
        return {"run": self.run, "started": self.started, "done": self.done}


@dataclass(frozen=True, slots=True)
class SimulatedStage:
    """The virtual stage of a run.

    Attributes:
        truth: the stage as it is.
        seed: of its noise and repeatability.
        faults: to inject; None for none.
    """

    truth: Machine
    seed: int = 1
    faults: FaultPlan | None = None


@dataclass(frozen=True, slots=True)
class HostSettings:
    """What the host does about friction.

    Attributes:
        mode: of compensation.
        friction_scale: factor on the friction figures that the host starts from.
        use_map: use the history's active friction map, where there is one.
        observer: correct force offsets by the settling observer, where an axis can have one.
        measurement: of the stage's responses, by which the observers are designed; None where it
            has not been measured: axes then have none, unless the machine file says so.
    """

    mode: Mode = Mode.ESTIMATED
    friction_scale: float = 1.0
    use_map: bool = True
    observer: bool = True
    measurement: Measurement | None = None


@dataclass(frozen=True, slots=True)
class RunRequest:
    """What to run.

    Attributes:
        recipe: checked against `machine`.
        machine: the stage as the host believes it to be.
        folder: for the files.
        started: time of the run, with zone.
        simulated: the virtual stage; None to use the machine's bus.
        host: what it does about friction.
        bus: (interface, channel) in place of the machine's.
        retries: attempts to repeat a segment (a site) after a recoverable fault.
        resumed: the interrupted run to continue; None to start at the beginning.
        history: file or server for the friction estimates; None for none.
        remarks: of the operator.
    """

    recipe: Recipe
    machine: Machine
    folder: Path
    started: datetime
    simulated: SimulatedStage | None = None
    host: HostSettings = HostSettings()
    bus: tuple[str, str] | None = None
    retries: int = 0
    resumed: Resumed | None = None
    history: str | None = None
    remarks: Remarks = Remarks()

    @property
    def truth(self) -> Machine | None:
        """The virtual stage as it is; None for a real one."""
        return None if self.simulated is None else self.simulated.truth

    def as_note(self) -> dict[str, Any]:
        """What the recording keeps of it, to resume, replay or summarise the run."""
        resumed, limits, host, truth = self.resumed, self.recipe.limits, self.host, self.truth
        return {
            "compensation": host.mode.value,
            "friction_scale": host.friction_scale,
            "observer": host.observer,
            "measurement": None if host.measurement is None else host.measurement.as_text(),
            "seed": 1 if self.simulated is None else self.simulated.seed,
            "simulated": truth is not None,
            "truth": None if truth is None or host.mode is not Mode.ORACLE else truth.text,
            "bus": None if self.bus is None else list(self.bus),
            "files": {
                "recipe": self.recipe.source,
                "machine": self.machine.source,
                "truth": None if truth is None else truth.source,
            },
            "retries": self.retries,
            "calibration": bool(self.recipe.excursions),
            "sites": [list(site) for site in self.recipe.sites] if self.recipe.excursions else None,
            "slipped": len(self.recipe.slipped),
            "stretches": count_segments(self.recipe),
            "unit": "site" if self.recipe.sites else "move",
            "limits": {
                "settling": limits.settling,
                "peak_error": limits.peak_error,
                "window": self.recipe.settle.window,
            },
            "use_map": host.use_map,
            "operator": self.remarks.operator,
            "comment": self.remarks.comment,
            "resumed": None if resumed is None else resumed.as_note(),
        }


@dataclass(frozen=True, slots=True)
class RunResult:
    """The result of a run.

    Attributes:
        summary: as in `summary.json`.
        recording: of the run; None where it ended before its first sample.
        error: that ended it early, or None.
        first_update: axis -> number of moves in the recording when its first estimate was accepted;
            an axis without one is absent.
        verdicts: pass or fail per completed site, where the recipe has limits.
        notices: what else the operator should know.
        unwritten: what the history lacks of the run, why, and how to file it, which is a notice
            too; None where it is complete.
    """

    summary: dict[str, Any]
    recording: Recording | None
    error: StagectlError | None
    first_update: dict[str, int]
    verdicts: tuple[SiteVerdict, ...]
    notices: tuple[str, ...] = ()
    unwritten: str | None = None
