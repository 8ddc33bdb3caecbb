"""Where to continue an interrupted run, from the files in its folder.

A run that faulted, was stopped or was killed has recorded every completed site (or entry of a list
of moves) and every friction estimate. Another run of the same recipe continues after the last one,
with the figures accepted last, in a folder of its own; its recording and summary name the earlier
run.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from stagectl.errors import UnusableInput
from stagectl.measurement import Measurement, parse_measurement
from stagectl.recipe import Recipe
from stagectl.run.recorded.documents import read_run, rewrite_documents
from stagectl.run.recorded.summarise import site_verdicts, summarise
from stagectl.run.request import Remarks, Resumed
from stagectl.sequencer import Figures
from stagectl.store import RECORDING_NAME, RunNotes, read_notes, reading_events, recover_folder


def load_interrupted(folder: Path, recipe: Recipe) -> Resumed:
    """Read where to continue a run; the journal of a killed run is recovered first.

    Args:
        folder: of the interrupted run.
        recipe: the same that the run was made with.

    Raises:
        UnusableInput: nothing is recorded there, or the run is complete, was made with another
            recipe, or by a version that did not record its progress.
        StagectlError: the run is still in progress.
    """
    if not folder.is_dir():
        raise UnusableInput(f"{folder}: no such folder")
    recovered, _ = recover_folder(folder)
    if recovered is not None and recovered.path is not None:
        rewrite_documents(recovered.path)
    path = folder / RECORDING_NAME
    if not path.exists():
        raise UnusableInput(
            f"{folder}: holds no recording: no sample was taken, run the recipe from its start"
        )
    notes = read_notes(path)
    if notes.outcome == "completed":
        raise UnusableInput(f"{path}: that run is complete, there is nothing to resume")
    if notes.recipe != recipe.text:
        raise UnusableInput(f"{path}: was made with another recipe than {recipe.source}")
    run = notes.last("run")
    if not run:
        raise UnusableInput(f"{path}: does not say how far the run got (made by an older version)")
    with reading_events(path):
        resumed = _resumed(folder, notes, run)
    return _with_verdicts(resumed, path, recipe)


def recorded_measurement(path: Path) -> Measurement | None:
    """The measurement of the stage that a recorded run had; None where it had none.

    Args:
        path: of its recording.

    Raises:
        UnusableInput: the recording cannot be read, or its measurement is damaged.
    """
    text = read_notes(path).last("run").get("measurement")
    return None if text is None else parse_measurement(str(text), f"{path}: measurement")


def _with_verdicts(resumed: Resumed, path: Path, recipe: Recipe) -> Resumed:
    """With the verdicts on the completed sites, by which the whole wafer is judged in the end."""
    if recipe.limits.settling is None and recipe.limits.peak_error is None:
        return resumed
    notes, recording, machine = read_run(path)
    return replace(
        resumed, verdicts=site_verdicts(summarise(notes, recording, None, machine, path))
    )


def _resumed(folder: Path, notes: RunNotes, run: Mapping[str, Any]) -> Resumed:
    before = None if run["resumed"] is None else Resumed.from_note(run["resumed"])
    done = [int(e["number"]) for e in notes.all("done")]
    friction = {} if before is None else dict(before.friction)
    for event in notes.all("friction"):
        if event["accepted"]:
            friction[str(event["axis"])] = _figures(
                event["parameters"], float(event.get("local", 1.0))
            )
    done.append(0 if before is None else before.done)
    remarks = Remarks(run.get("operator"), run.get("comment"))
    return Resumed(str(folder), notes.started, max(done), friction, remarks=remarks)


def _figures(parameters: Mapping[str, Sequence[float]], local: float) -> Figures:
    """Figures of a `friction` event; the relaxation rate is C / Fc: relative variances add.

    `local`: known factor on the Coulomb force where they were found.
    """
    known = {name: _pair(pair) for name, pair in parameters.items()}
    for name in ("coulomb", "attraction"):
        if name in known:
            known[name] = (known[name][0] / local, known[name][1] / local)
    if "attraction" not in known:
        return known
    attraction, sigma = known.pop("attraction")
    coulomb, coulomb_sigma = known["coulomb"]
    rate = attraction / coulomb
    variance = (sigma / attraction) ** 2 - (coulomb_sigma / coulomb) ** 2
    known["relaxation_rate"] = (rate, rate * math.sqrt(max(variance, 1e-6)))
    return known


def _pair(pair: Sequence[float]) -> tuple[float, float]:
    value, sigma = float(pair[0]), float(pair[1])
    if not (math.isfinite(value) and math.isfinite(sigma) and value > 0 and sigma > 0):
        raise ValueError(f"friction figure {value!r} with sigma {sigma!r}")
    return value, sigma
