"""Runs the host again on a bus log, with recipe, machine and settings of the recording.

Its files go to a temporary folder.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import islice
from pathlib import Path
from typing import Any

from drivers.commissioning import FrameDecoder
from stagectl import store
from stagectl.config.machine import Machine
from stagectl.config.machine.file import parse_machine
from stagectl.config.settings.package_settings import driver_settings
from stagectl.errors import UnusableInput
from stagectl.maps import restore_snapshot
from stagectl.measurement import Measurement, parse_measurement
from stagectl.recipe import Pair, parse_recipe
from stagectl.run.checks import Substitutes
from stagectl.run.execution import execute
from stagectl.run.listener import Listener
from stagectl.run.replay.bus import Difference, ReplayBus
from stagectl.run.request import HostSettings, Resumed, RunRequest, SimulatedStage
from stagectl.sequencer import Mode


@dataclass(frozen=True, slots=True)
class ReplayResult:
    """The result of a replay.

    Attributes:
        frames: number of frames in the log.
        compared: number of frames of the host that agreed.
        difference: the first one, or None.
        digest: SHA-256 of the log.
        sealed: whether the log is as the run wrote it; None where it carries no digest.
        outcome: of the recorded run.
        words: the recorded and the sent frame of the difference in words; "" where there is none.
    """

    frames: int
    compared: int
    difference: Difference | None
    digest: str
    sealed: bool | None
    outcome: str
    words: tuple[str, str] = ("", "")


@dataclass(frozen=True, slots=True)
class _RecordedMarks:
    """A `Fiducial` that finds the marks found then."""

    offsets: Mapping[int, Pair]

    def find(self, site: int, position: Pair) -> Pair | None:
        return self.offsets.get(site)


def replay(folder: Path, listener: Listener | None = None) -> ReplayResult:
    """Run the host again on the log of a run.

    Args:
        folder: of the run; after a kill, journal and log are recovered first.
        listener: called as the replay proceeds.

    Raises:
        UnusableInput: there is no recording or log, they lack what a replay needs, or the run was
            in real time or a calibration.
        StagectlError: the run is still in progress.
        ConfigError: machine or recipe of the recording can no longer be used.
    """
    if not folder.is_dir():
        raise UnusableInput(f"{folder}: no such folder")
    store.recover_folder(folder)
    path = folder / store.RECORDING_NAME
    if not path.exists():
        raise UnusableInput(f"{folder}: holds no recording: no sample was taken")
    notes = store.read_notes(path)
    log = store.read_log(folder / store.LOG_NAME)
    run = notes.last("run")
    if not run:
        raise UnusableInput(f"{path}: does not say how it was run (made by an older version)")
    with tempfile.TemporaryDirectory() as scratch:
        with store.reading_events(path):
            if notes.all("held_stage"):
                raise UnusableInput(
                    f"{path}: was run by a stage server on axes that it held already: its bus log "
                    "lacks how they were made ready, so it cannot be replayed"
                )
            _refuse_unless_replayable(path, run)
            machine = parse_machine(notes.machine, str(run["files"]["machine"]))
            request = _request(notes, run, machine, Path(scratch))
            bus = ReplayBus(log.frames(), log.count, notes.outcome != "killed")
            snapshot = run.get("map_then")
            active = None if snapshot is None else restore_snapshot(snapshot, machine, str(path))
            substitutes = Substitutes(bus, _RecordedMarks(_marks(notes)), _stop(notes), active)
            seals = [str(e["digest"]) for e in notes.all("bus_log")]
        with bus:
            execute(request, listener or Listener(), substitutes)
    bus.finish()
    stated = {s for s in (log.stated, *seals) if s is not None}
    return ReplayResult(
        log.count,
        bus.compared,
        bus.difference,
        log.digest,
        None if not stated else stated == {log.digest},
        notes.outcome,
        ("", "") if bus.difference is None else _in_words(bus.difference, log, machine),
    )


def _in_words(difference: Difference, log: store.LoggedBus, machine: Machine) -> tuple[str, str]:
    """The frames of a difference; what PDOs hold is heard from the frames before it."""
    decoder = FrameDecoder(driver_settings(machine)[1])
    for frame in islice(log.frames(), difference.number - 1):
        decoder.decode(frame.can_id, frame.data)

    def words(frame: store.LoggedFrame | None) -> str:
        if frame is None:
            return ""
        decoded = decoder.decode(frame.can_id, frame.data)
        return f"{decoded.who}, {decoded.service}: {decoded.text}"

    return words(difference.recorded), words(difference.sent)


def _refuse_unless_replayable(path: Path, run: Mapping[str, Any]) -> None:
    """Raise where a run depended on what its files do not hold.

    Raises:
        UnusableInput: naming the recording and the reason.
    """
    if not run["simulated"]:
        raise UnusableInput(
            f"{path}: was run in real time and depended on readings of the clock, which no log "
            "holds; runs with --simulate can be replayed"
        )
    if run.get("calibration") or run.get("slipped"):
        what = "was a calibration" if run.get("calibration") else "had calibration sites inserted"
        raise UnusableInput(
            f"{path}: {what}: a calibration's moves are not in the recipe; runs with "
            "--simulate and without any can be replayed"
        )
    if run.get("observer") and "measurement" not in run:
        raise UnusableInput(
            f"{path}: was run with an observer by an older version, which did not measure the "
            "stage; this version cannot repeat it"
        )
    if run.get("map") is not None and run.get("map_then") is None:
        raise UnusableInput(
            f"{path}: used friction map {run['map']} as it stood then, which recordings of that "
            "version do not hold"
        )


def _request(
    notes: store.RunNotes, run: Mapping[str, Any], machine: Machine, scratch: Path
) -> RunRequest:
    seed, text, resumed = int(run["seed"]), run["truth"], run["resumed"]
    simulated = None
    if text is not None:
        simulated = SimulatedStage(parse_machine(text, str(run["files"]["truth"])), seed)
    return RunRequest(
        parse_recipe(notes.recipe, str(run["files"]["recipe"]), machine),
        machine,
        scratch,
        datetime.now(UTC),
        simulated,
        host=HostSettings(
            mode=Mode(run["compensation"]),
            friction_scale=float(run["friction_scale"]),
            observer=bool(run.get("observer", False)),
            measurement=_measurement(run),
        ),
        retries=int(run["retries"]),
        resumed=None if resumed is None else Resumed.from_note(resumed),
    )


def _measurement(run: Mapping[str, Any]) -> Measurement | None:
    text = run["measurement"] if run.get("observer") else None
    return None if text is None else parse_measurement(text, "measurement of the recording")


def _marks(notes: store.RunNotes) -> dict[int, Pair]:
    return {
        int(e["site"]): (float(e["offset"][0]), float(e["offset"][1])) for e in notes.all("mark")
    }


def _stop(notes: store.RunNotes) -> tuple[int, str] | None:
    """Number of samples after which the operator's stop took effect, and its reason."""
    stop = notes.last("stop")
    return None if not stop else (int(stop["sample"]), str(stop["reason"]))
