"""The measurement of a virtual stage: made the first time a truth and a machine file meet.

It goes through CAN frames on a virtual stage of its own, in virtual time, with a fixed seed. The
responses are kept in the user's cache, by all that they depend on.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from importlib import util
from pathlib import Path

from stagectl.config.machine import Machine
from stagectl.measurement.document import Measurement, parse_measurement
from stagectl.measurement.procedure import measure_stage, ready_stage

SEED = 1
KEPT = 100
"""Responses that are kept, the latest; each takes some 80 kB."""
_PACKAGES = ("drivers", "estimation", "hil_sim", "stagectl", "stagedata")


def measure_virtual_stage(
    machine: Machine, truth: Machine, announce: Callable[[str], object] = lambda _: None
) -> Measurement:
    """The responses of a virtual stage.

    Args:
        machine: as the host believes it.
        truth: as it is.
        announce: called with a few words where it has to be measured.

    Raises:
        RunFault: it cannot be measured: a limit was exceeded, or a drive faulted.
        UnusableInput: it has no axis that can be measured.
    """
    kept = _folder() / f"{_key(machine, truth)}.json"
    text = None
    with suppress(OSError, UnicodeDecodeError):
        text = kept.read_text()
    if text is None:
        announce("measuring the virtual stage for the observer, once")
        text = measure_simulated(machine, truth, SEED).as_text()
        keep(kept, text)
    return parse_measurement(text, "measurement of the virtual stage")


def measure_simulated(machine: Machine, truth: Machine, seed: int) -> Measurement:
    """Measure a virtual stage, through CAN frames in virtual time; arguments as above.

    Raises:
        RunFault, UnusableInput: as above.
    """
    from hil_sim.bus import World
    from hil_sim.stage import VirtualStage
    from stagectl.config.settings.package_settings import stage_settings

    world = World(f"measurement-{id(machine)}")
    VirtualStage(stage_settings(truth), seed).attach(world)
    with ready_stage(machine, ("lockstep", world.name)) as stage:
        return measure_stage(stage, machine)


def _folder() -> Path:
    cached = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    return Path(cached).expanduser() / "stagectl" / "responses"


def _key(machine: Machine, truth: Machine) -> str:
    whole = "\0".join((machine.model_dump_json(), truth.model_dump_json(), _program()))
    return hashlib.sha256(whole.encode()).hexdigest()[:32]


@cache
def _program() -> str:
    """This program's code, by the times of its files."""
    stamps = []
    for package in _PACKAGES:
        spec = util.find_spec(package)
        for root in (spec.submodule_search_locations or ()) if spec is not None else ():
            stamps += sorted(
                f"{path}:{info.st_mtime_ns}:{info.st_size}"
                for path in Path(root).rglob("*.py")
                for info in (path.stat(),)
            )
    return hashlib.sha256("\n".join(stamps).encode()).hexdigest()


def keep(path: Path, text: str) -> None:
    """Keep a text for the next time; where there is no room or permission it is made again."""
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile("w", dir=path.parent, delete=False) as part:
            part.write(text)
        Path(part.name).replace(path)
        kept = sorted(path.parent.glob("*.json"), key=lambda file: file.stat().st_mtime_ns)
        for old in kept[:-KEPT]:
            old.unlink(missing_ok=True)
