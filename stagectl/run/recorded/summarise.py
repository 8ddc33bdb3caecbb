"""The summary of a run from its recording alone.

The same when the run ends, after a kill, and whenever it is made again.
"""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from stagectl.config import without_password
from stagectl.config.machine import Machine
from stagectl.errors import UnusableInput
from stagectl.history import default_history
from stagectl.recipe import SiteLimits
from stagectl.run.request import Resumed
from stagectl.sequencer import Mode, SiteVerdict, judge
from stagectl.store import CycleLedger, RunNotes, finite, reading_events, summarise_samples
from stagedata import Recording

UNITS = {"coulomb": "N", "viscous": "N s/m", "stiffness": "N/m", "attraction": "N/s"}
"""Friction figures of a summary and their units."""

Note = Mapping[str, Any]


def run_note(notes: RunNotes, path: Path) -> Note:
    """The event `run` of a recording.

    Raises:
        UnusableInput: an older version or another program made it, which has no such event.
    """
    run = notes.last("run")
    if "history" not in run:
        raise UnusableInput(f"{path}: does not say how it was run (not by this version)")
    return run


def summarise(
    notes: RunNotes,
    recording: Recording,
    ledger: CycleLedger | None,
    machine: Machine,
    path: Path,
) -> dict[str, Any]:
    """Build the summary of a run as JSON values.

    Args:
        notes: of the recording, or of the journal.
        recording: without samples where the run never moved.
        ledger: punctuality, where it is known.
        machine: as the host believed it to be.
        path: of the recording; its folder is the run's.

    Raises:
        UnusableInput: an older version made the recording, or its events are damaged.
    """
    run = run_note(notes, path)
    measured = summarise_samples(
        recording, _control_period(machine), machine.bus.sync_period, ledger
    )
    with reading_events(path):
        return {
            "format": "stagectl-run-summary",
            "version": 1,
            "recipe": run["history"]["recipe"],
            "machine": run["history"]["stage"]["machine"],
            "compensation": run["compensation"],
            "seed": run["seed"],
            "simulated": run["simulated"],
            "lot": run["history"]["lot"],
            "duration": round(len(recording) * machine.bus.sync_period, 9),
            "wall_time": finite(notes.last("end").get("wall_time")),
            "outcome": notes.outcome,
            "fault": notes.fault,
            "moves": measured.pop("moves"),
            "friction": [_friction(event) for event in notes.all("friction")],
            **measured,
            **_where_it_applies(notes, run, recording, machine, path.parent),
        }


def _control_period(machine: Machine) -> float:
    return next(iter(machine.axes.values())).drive.control_period


def _where_it_applies(
    notes: RunNotes, run: Note, recording: Recording, machine: Machine, folder: Path
) -> dict[str, Any]:
    """The keys that not every summary has."""
    resumed = None if run["resumed"] is None else Resumed.from_note(run["resumed"])
    unfiled = notes.last("unfiled")
    found = {
        "started": notes.started or None,
        "wafer": run["history"]["wafer"],
        "operator": run.get("operator"),
        "comment": run.get("comment"),
        "limits": _limits(notes, run, recording, machine, resumed),
        "interrupted": _interrupted(notes, run, recording, machine, folder, resumed),
        "map": run["map"],
        "map_comment": run.get("map_comment") or None,
        "observer": notes.last("observer").get("axes") or None,
        "watchdog": _picked(notes, "observer_found", "axis", "time", "out", "text"),
        "feedforward": notes.last("feedforward").get("axes") or None,
        "steps": _picked(notes, "level_stepped", "axis", "place", "time", "change", "everywhere"),
        "effects": run.get("effects") or None,
        "history": {name: unfiled[name] for name in ("filed", "estimates")} if unfiled else None,
        "resumed": None if resumed is None else resumed.link(),
        "retries": _picked(notes, "retry", "site", "attempt", "fault"),
    }
    return {key: value for key, value in found.items() if value is not None}


def _interrupted(
    notes: RunNotes,
    run: Note,
    recording: Recording,
    machine: Machine,
    folder: Path,
    resumed: Resumed | None,
) -> dict[str, Any] | None:
    """Where and why the run ended early, and what to type; None where it did not."""
    if notes.outcome == "completed" or "stretches" not in run:
        return None
    before = 0 if resumed is None else resumed.done
    done = max((int(e["number"]) for e in notes.all("done")), default=before)
    return {
        "reason": notes.fault or notes.last("end").get("reason") or "the process was killed",
        "unit": run["unit"],
        "done": done,
        "of": run["stretches"],
        "at": done + 1 if _is_begun(notes, recording) else None,
        "resume": _resume(run, machine, folder if len(recording) else resumed),
    }


def _picked(notes: RunNotes, event: str, *keys: str) -> list[dict[str, Any]] | None:
    """These keys of all events of a name; None where there are none."""
    return [{key: e[key] for key in keys} for e in notes.all(event)] or None


def _is_begun(notes: RunNotes, recording: Recording) -> bool:
    """Whether there is a move after the last completed segment."""
    since = int(notes.last("done").get("sample", 0))
    return any(move.start >= since for move in recording.moves)


def _resume(run: Note, machine: Machine, of: Path | Resumed | None) -> str | None:
    """The command that continues the run, or the one that it continued where it never moved."""
    if of is None:
        return None
    return resume_command(run, machine, of.run if isinstance(of, Resumed) else str(of))


def _limits(
    notes: RunNotes, run: Note, recording: Recording, machine: Machine, resumed: Resumed | None
) -> dict[str, Any] | None:
    """Verdicts on the completed sites and on the wafer; None where the recipe has no limits."""
    limits = run.get("limits")
    if limits is None or run["unit"] != "site":
        return None
    allowed = SiteLimits(limits["settling"], limits["peak_error"])
    if allowed.settling is None and allowed.peak_error is None:
        return None
    done = {e["site"] for e in notes.all("done")}
    found = judge(
        recording, allowed, limits["window"], _control_period(machine), machine.bus.sync_period
    )
    sites = [
        *(() if resumed is None else resumed.verdicts),
        *(verdict for verdict in found if verdict.site in done),
    ]
    failed = sum(bool(verdict.failures) for verdict in sites)
    complete = len(sites) == run["stretches"]
    return {
        **limits,
        "verdict": "fail" if failed else "pass" if complete else "incomplete",
        "passed": len(sites) - failed,
        "failed": failed,
        "of": run["stretches"],
        "sites": [
            {"site": v.site, "passed": not v.failures, "failures": list(v.failures)} for v in sites
        ],
    }


def site_verdicts(summary: Note) -> tuple[SiteVerdict, ...]:
    """The verdicts of a summary on its sites."""
    sites: Sequence[Note] = summary.get("limits", {}).get("sites", ())
    return tuple(SiteVerdict(entry["site"], tuple(entry["failures"])) for entry in sites)


def _friction(event: Note) -> dict[str, Any]:
    return {
        **{key: event[key] for key in ("site", "axis", "accepted", "reason")},
        "compute_time": finite(event.get("compute_time")),
        "parameters": {
            name: {"value": finite(value), "sigma": finite(sigma), "unit": UNITS[name]}
            for name, (value, sigma) in event["parameters"].items()
        },
        "gain": {name: finite(gain) for name, gain in event.get("gain", {}).items()},
        "held": list(event["held"]),
    }


def resume_command(run: Mapping[str, Any], machine: Machine, folder: str) -> str:
    """The command line.

    Injected faults are not repeated; operator and comment need not be: the continuation keeps them.

    Args:
        run: event `run` of the recording.
        machine: as the host believed it to be.
        folder: of the run to continue.
    """
    files, simulated = run["files"], run["simulated"]
    words = ["stagectl", "calibrate" if run["calibration"] else "run", files["recipe"]]
    if not files["machine"].endswith(" (packaged)"):
        words += ["--machine", files["machine"]]
    if simulated:
        words.append("--simulate")
        if files["truth"] != files["machine"]:
            words.append(files["truth"].removesuffix(".yaml (packaged)"))
        if run["seed"] != 1:
            words += ["--seed", str(run["seed"])]
    if run["bus"] is not None:
        words += ["--bus", ":".join(run["bus"])]
    if run["compensation"] != Mode.ESTIMATED.value:
        words += ["--compensation", run["compensation"]]
    if run["friction_scale"] != 1.0:
        words += ["--friction-scale", f"{run['friction_scale']:g}"]
    if run["retries"]:
        words += ["--retries", str(run["retries"])]
    if not run.get("use_map", True):
        words += ["--map", "none"]
    if not run.get("observer", True) and not run["calibration"]:  # which never has one
        words.append("--no-observer")
    where = run["history"]["where"]
    if where != _usual_history(machine, simulated):
        words += ["--history", where or "none"]
    return shlex.join([*words, "--resume", folder])


def _usual_history(machine: Machine, simulated: bool) -> str | None:
    """The history of a run without `--history` and `--out`, as a recording names it."""
    where = default_history(None, machine, simulated, Path("runs") / machine.name, own=False)
    return None if where is None else without_password(where)
