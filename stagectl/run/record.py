"""The record of a run: its journal as it proceeds; recording, summary and report at its end.

Takes the moves and events of the run, writes down what a reader of the recording, a resumed run or
a replay needs, and knows how much of the recipe is done.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

from estimation.observer import Design
from hil_sim.bus import InjectedFault
from stagectl.config import without_password
from stagectl.config.settings.known_effects import KnownEffect
from stagectl.errors import Aborted, StagectlError
from stagectl.history import (
    EstimateRecord,
    LatestTemperature,
    note_of_estimate,
    note_of_run,
    open_history,
)
from stagectl.maps import ActiveMap, take_snapshot
from stagectl.run.recorded.documents import write_documents
from stagectl.run.recorded.summarise import UNITS, site_verdicts
from stagectl.run.request import RunRequest, RunResult
from stagectl.run.run_history import RunHistory, run_entry
from stagectl.sequencer import Event, events
from stagectl.store import (
    LOG_NAME,
    RECORDING_NAME,
    AxisScaling,
    Journal,
    JournalHeader,
    find_log,
    finite,
    recover_journal,
)
from stagedata import Move

OUTPUTS = ("recording.h5", "summary.json", "report.html")
"""Files of a run, besides its bus log."""
_ESTIMATED_AS = {"attraction": "relaxation_rate"}
"""Figures that the estimator has in another form."""


class RunRecord:
    """The record of one run; creates the journal.

    Args:
        request: of the run.
        started: in the time of the history [s since 1970].
        active: the friction map that the run uses; None for none.
        effects: of the host's machine file, and whether they are compensated.

    Attributes:
        effects: as above.
        temperature: of the stage, set once it is open.
        journal: of the run.
        done: completed segments of the recipe, those of the resumed run included.
        wall_time: of the moves [s], set once they are over.

    Raises:
        StagectlError: the journal cannot be written.
    """

    def __init__(
        self,
        request: RunRequest,
        started: float,
        active: ActiveMap | None = None,
        effects: Sequence[KnownEffect] = (),
    ) -> None:
        self._request, self.effects = request, tuple(effects)
        self.temperature = LatestTemperature(None)
        self._has_map = active is not None
        snapshot = None if active is None else take_snapshot(active)
        where = request.history
        self._history = RunHistory(
            run_entry(request, started),
            None if where is None else partial(open_history, where, write=True),
        )
        _set_aside_files(request.folder)
        machine, resumed = request.machine, request.resumed
        self.done = 0 if resumed is None else resumed.done
        self.wall_time = 0.0
        self._unwritten: str | None = None
        self._notices: list[str] = []
        self._first_update: dict[str, int] = {}
        self._moves = 0
        self.journal = Journal(
            request.folder,
            JournalHeader(
                machine.text,
                request.recipe.text,
                request.started.isoformat(),
                tuple(
                    AxisScaling(name, axis.drive.position_unit, axis.drive.force_unit)
                    for name, axis in machine.axes.items()
                ),
            ),
        )
        self.journal.event(
            "run",
            **request.as_note(),
            map=None if active is None else active.version.number,
            map_comment="" if active is None else active.version.comment,
            effects=[asdict(effect) for effect in self.effects],
            map_then=snapshot,
            history=note_of_run(
                self._history.entry, None if where is None else without_password(where)
            ),
        )

    def start(self) -> None:
        """The drives have answered: enter the run in its history."""
        self._history.start()

    def note_observer(self, designs: Mapping[str, Design | str], is_on: Sequence[bool]) -> None:
        """Note the observer of each axis, or why it has none."""
        observers: dict[str, dict[str, Any]] = {}
        for (name, found), on in zip(designs.items(), is_on, strict=True):
            if isinstance(found, str):
                own: dict[str, Any] = {"reason": found}
            elif on:
                own = {"gain": found.gain, "time_constant": found.time_constant}
            else:
                own = {"reason": "the drive has no force offset (0x60B2)"}
            observers[name] = {"on": "reason" not in own, **own}
        self.journal.event("observer", axes=observers)

    def note_move(self, move: Move) -> None:
        """Note a move, before its first sample."""
        self._moves += 1
        self.journal.move(move)

    def note_event(self, event: Event) -> None:
        """Note an event."""
        match event:
            case events.FrictionUpdated():
                now = self.temperature.at(event.time)
                record = self._history.estimate(event, self._has_map, now)
                self._note_friction(event, record)
                self._history.file(record)
            case events.LevelStepped():
                self.journal.event("level_stepped", **asdict(event))
                self._history.file(self._history.step(event))
            case events.ObserverFound():
                self.journal.event("observer_found", **asdict(event))
                self.note_limitations([event.text])
            case events.Limitation(text=text):
                self.note_limitations([text])
            case events.SegmentDone(number=number, site=site):
                self.done = number
                self.journal.event("done", number=number, site=site)
            case events.Retrying(segment=segment, attempt=attempt, fault=fault):
                site = segment if self._request.recipe.sites else None
                self.journal.event("retry", site=site, attempt=attempt, fault=fault)
            case events.MarkFound(site=site, offset=offset):
                self.journal.event("mark", site=site, offset=offset)
            case events.MarkNotFound(site=site):
                self.note_limitations([f"site {site}: mark not found, no micro-move"])
            case events.StopNoticed(reason=reason):
                self.journal.event("stop", reason=reason)

    def note_injected_faults(self, injected: Sequence[InjectedFault]) -> None:
        """Note the faults that were injected."""
        for entry in injected:
            self.journal.event(
                "injected_fault",
                fault=repr(entry.fault),
                count=entry.count,
                first=entry.first_ns * 1e-9 if entry.count else None,
            )

    def abandon(self) -> None:
        """After an unforeseen error: make a recording of the samples so far."""
        self.journal.finish("fault", "internal error")
        self._history.end("fault", "internal error")
        recover_journal(self.journal.path, overwrite=True)

    def note_limitations(self, notices: Sequence[str]) -> None:
        """Note what drives, computer or map lack, for the operator and the recording."""
        for notice in notices:
            if notice not in self._notices:
                self._notices.append(notice)
                self.journal.event("limitation", text=notice)

    def end(self, error: StagectlError | None) -> None:
        """Close journal and history: all that the files are made of.

        Args:
            error: that ended the run early, or None.
        """
        outcome = (
            "completed" if error is None else "aborted" if isinstance(error, Aborted) else "fault"
        )
        fault = str(error) if outcome == "fault" else None
        reason = None if error is None else str(error)
        self.journal.event("end", wall_time=self.wall_time, reason=reason)
        self.journal.note_outcome(outcome, fault)
        self._history.end(outcome, fault)
        self._unwritten = self._history.unwritten(self._request.folder)
        if self._unwritten is not None:
            self._notices.append(self._unwritten)
            filed, made = self._history.filed, self._history.made
            self.journal.event("unfiled", filed=filed, estimates=made)
        self.journal.close()

    def finish(self, error: StagectlError | None) -> RunResult:
        """`end`, then make recording, summary and report of the journal."""
        self.end(error)
        request, machine, notices = self._request, self._request.machine, self._notices
        content = recover_journal(self.journal.path, overwrite=True).content
        assert content is not None  # noqa: S101  the journal has its header
        notices += [] if content.problem is None else [content.problem]
        has_samples = len(content.recording) > 0
        summary = write_documents(
            content.notes,
            content.recording,
            content.ledger if has_samples else None,
            machine,
            request.folder / RECORDING_NAME,
        )
        return RunResult(
            summary,
            content.recording if has_samples else None,
            error,
            dict(self._first_update),
            site_verdicts(summary),
            tuple(notices),
            self._unwritten,
        )

    def _note_friction(self, event: events.FrictionUpdated, record: EstimateRecord) -> None:
        estimate, figures = event.estimate, dict(record.figures)
        sigma, gain, held = dict(estimate.sigma), estimate.gain, estimate.held
        if "relaxation_rate" in figures:
            rate = sigma.pop("relaxation_rate") / figures["relaxation_rate"]
            # C = rate Fc: relative variances add.
            relative = (rate**2 + (sigma["coulomb"] / figures["coulomb"]) ** 2) ** 0.5
            figures["attraction"] = figures["relaxation_rate"] * figures["coulomb"]
            sigma["attraction"] = figures["attraction"] * relative
        units = [name for name in UNITS if name in figures]
        self.journal.event(
            "friction",
            site=event.site,
            axis=event.axis,
            accepted=estimate.accepted,
            reason=estimate.reason,
            compute_time=finite(event.compute_time),
            parameters={name: (finite(figures[name]), finite(sigma[name])) for name in units},
            gain={name: finite(gain[_ESTIMATED_AS.get(name, name)]) for name in units},
            held=[name for name in units if _ESTIMATED_AS.get(name, name) in held],
            local=event.local,
            record=note_of_estimate(record),
        )
        if estimate.accepted:
            self._first_update.setdefault(event.axis, self._moves)


def _set_aside_files(folder: Path) -> None:
    """Move the files of an earlier run to `previous/`, so as not to mistake them for this one's."""
    log = find_log(folder / LOG_NAME)
    old = [*(folder / name for name in OUTPUTS if (folder / name).exists()), *log]
    if old:
        previous = folder / "previous"
        previous.mkdir(exist_ok=True)
        for earlier in find_log(previous / LOG_NAME) if log else ():
            earlier.unlink()
        for path in old:
            path.replace(previous / path.name)
