"""The command line that continues an interrupted run, with the options that it was made with."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from stagectl.config import without_password
from stagectl.config.machine import Machine
from stagectl.history import default_history
from stagectl.sequencer import Mode


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
