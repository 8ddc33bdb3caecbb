"""The host run again on its own log: recipe, machine and settings are those of the recording.

Nothing is written but to a folder of its own, which is thrown away.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from stagectl.config.machine import Machine
from stagectl.config.machine_file import parse_machine
from stagectl.errors import UnusableInput
from stagectl.maps import noted
from stagectl.recipe import Pair, parse_recipe
from stagectl.run.replay.bus import Difference, ReplayBus
from stagectl.run.request import Resumed, RunRequest
from stagectl.run.session import Listener, Rig, execute
from stagectl.sequencer import Mode
from stagectl.store import LOG_NAME, RECORDING_NAME, RunNotes, read_log, read_notes, recover_folder


@dataclass(frozen=True, slots=True)
class Replayed:
    """How a replay went.

    Attributes:
        frames: in the log.
        compared: frames that the host sent, and that were the same.
        difference: the first one, or None.
        digest: SHA-256 of the log.
        sealed: whether the log is as the run wrote it; None where it carries no digest.
        outcome: how the run ended that was recorded.
        machine: that the host believed in.
    """

    frames: int
    compared: int
    difference: Difference | None
    digest: str
    sealed: bool | None
    outcome: str
    machine: Machine


@dataclass(frozen=True, slots=True)
class _Marks:
    """The marks that were found."""

    offsets: Mapping[int, Pair]

    def find(self, site: int, position: Pair) -> Pair | None:
        return self.offsets.get(site)


def replay(folder: Path, listener: Listener | None = None) -> Replayed:
    """Run the host again on the log of a run.

    Args:
        folder: of the run; of one that was killed, the journal and the log are recovered first.
        listener: told of the run as it goes.

    Raises:
        UnusableInput: no recording or log there, they do not tell what is needed, or the run was
            in real time.
        StagectlError: the run still goes on.
        ConfigError: machine or recipe of the recording cannot be used any more.
    """
    if not folder.is_dir():
        raise UnusableInput(f"{folder}: no such folder")
    recover_folder(folder)
    path = folder / RECORDING_NAME
    if not path.exists():
        raise UnusableInput(f"{folder}: holds no recording: no sample was taken")
    notes = read_notes(path)
    log = read_log(folder / LOG_NAME)
    run = next((e for e in notes.events if e.get("event") == "run"), None)
    if run is None:
        raise UnusableInput(f"{path}: does not tell how it was run (made by an older version)")
    with tempfile.TemporaryDirectory() as scratch:
        try:
            if not run["simulated"]:
                raise UnusableInput(
                    f"{path}: was run in real time: what the host did then depended on readings of "
                    "the clock that no log has; runs with --simulate can be replayed"
                )
            seals = [str(e["digest"]) for e in notes.events if e.get("event") == "bus_log"]
            if run.get("calibration") or run.get("slipped"):
                what = "was a calibration" if run.get("calibration") else "had some slipped into it"
                raise UnusableInput(
                    f"{path}: {what}: a calibration's moves are not in the recipe; runs with "
                    "--simulate and without any can be replayed"
                )
            if run.get("map") is not None and run.get("map_then") is None:
                raise UnusableInput(
                    f"{path}: went by friction map {run['map']} as it stood then, which "
                    "recordings did not hold yet when it was made"
                )
            machine = parse_machine(notes.machine, str(run["files"]["machine"]))
            request = _request(notes, run, machine, Path(scratch))
            bus = ReplayBus(log.frames, notes.outcome != "killed")
            then = run.get("map_then")
            active = None if then is None else noted(then, machine, str(path))
            rig = Rig(bus, _Marks(_marks(notes)), _stop(notes), active)
        except (KeyError, TypeError, ValueError, AttributeError) as damage:
            reason = f"{type(damage).__name__}: {damage}"
            raise UnusableInput(f"{path}: /events: damaged ({reason})") from damage
        with bus:
            execute(request, listener or Listener(), rig)
    bus.finish()
    stated = {s for s in (log.stated, *seals) if s is not None}
    return Replayed(
        len(log.frames),
        bus.compared,
        bus.difference,
        log.digest,
        None if not stated else stated == {log.digest},
        notes.outcome,
        machine,
    )


def _request(
    notes: RunNotes, run: Mapping[str, Any], machine: Machine, scratch: Path
) -> RunRequest:
    truth, resumed = run["truth"], run["resumed"]
    return RunRequest(
        recipe=parse_recipe(notes.recipe, str(run["files"]["recipe"]), machine),
        machine=machine,
        truth=None if truth is None else parse_machine(truth, str(run["files"]["truth"])),
        bus=None,
        mode=Mode(run["compensation"]),
        friction_scale=float(run["friction_scale"]),
        seed=int(run["seed"]),
        folder=scratch,
        started=datetime.now(UTC),
        retries=int(run["retries"]),
        resumed=None if resumed is None else Resumed.noted(resumed),
    )


def _marks(notes: RunNotes) -> dict[int, Pair]:
    return {
        int(e["site"]): (float(e["offset"][0]), float(e["offset"][1]))
        for e in notes.events
        if e["event"] == "mark"
    }


def _stop(notes: RunNotes) -> tuple[int, str] | None:
    """After how many samples the operator's request to stop was seen."""
    stop = next((e for e in notes.events if e["event"] == "stop"), None)
    return None if stop is None else (int(stop["sample"]), str(stop["reason"]))
