"""What the watchdog of the observers has found, in words, and kept until the next measurement.

On a real stage an observer that fed an oscillation stays out in later runs, too: a small file
beside the machine file says so. A run on the virtual stage starts afresh.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path

from estimation.observer import Finding, Kind
from stagectl.config.machine import Machine
from stagectl.errors import UnusableInput
from stagectl.store.atomic import write_atomically

FORMAT, VERSION = "stagectl-observer-out", 1
_SUFFIX = ".observer-out.json"


def describe(axis: str, found: Finding) -> str:
    """A finding in one line, with what to do."""
    deviation, when = _length(found.rms), f"{found.time:.3f} s"
    pitch = f" of {found.frequency:.0f} Hz" if found.frequency >= 0.5 else ""
    wave = f"an oscillation{pitch} ({deviation} rms)"
    match found.kind:
        case Kind.FED:
            why = f"the observer fed {wave}: the stage is not as believed"
        case Kind.STANDS:
            why = (
                f"at a constant speed a deviation of {deviation} stands that the drive does not "
                "see: 0x6064 is not the position that it holds"
            )
        case Kind.UNANSWERED:
            why = (
                f"the drive does not answer a deviation of {deviation}: 0x6064 is not the "
                "position that it holds, or 0x60B2 does not act as the observer believes"
            )
        case Kind.GROWS:
            why = (
                f"a deviation of {deviation} grows while the correction pushes against it: the "
                "stage is not as believed (0x60B2 of the other sign or late, another mass, or "
                "0x6064 not the position that the drive holds)"
            )
        case Kind.SUSPECTED:
            return (
                f"axis {axis}: the run ended before it was clear whether the observer, frozen at "
                f"{when}, fed {wave}"
            )
        case _:
            return (
                f"axis {axis}: {wave} goes on without the observer, which was frozen at {when} to "
                "see: it comes from elsewhere (a vibration, or the drive's own loop)"
            )
    return f"axis {axis}: {why}; the observer is out from {when} on (docs/explanation/observer.md)"


def is_out(found: Finding) -> bool:
    """Whether the observer stays out."""
    return found.kind in (Kind.FED, Kind.STANDS, Kind.UNANSWERED, Kind.GROWS)


def _length(metres: float) -> str:
    return f"{metres * 1e6:.3g} µm" if metres >= 1e-6 else f"{metres * 1e9:.0f} nm"


def kept_in(machine: Machine) -> Path | None:
    """The file of a machine's observers that are out; None where the machine file is no file."""
    source = Path(machine.source)
    return source.with_name(source.stem + _SUFFIX) if source.is_file() else None


def read_out(machine: Machine, measured: str | None = None) -> dict[str, str]:
    """Axes whose observers are out since an earlier run, and why.

    Args:
        machine: the host's.
        measured: when the stage was measured, ISO 8601: what was found before counts no more.

    Raises:
        UnusableInput: the file is damaged.
    """
    path = kept_in(machine)
    if path is None or not path.exists():
        return {}
    try:
        kept = json.loads(path.read_text(encoding="utf-8"))
        if (kept["format"], kept["version"]) != (FORMAT, VERSION):
            raise ValueError(f"is not {FORMAT}, version {VERSION}")
        since = None if measured is None else datetime.fromisoformat(measured)
        return {
            str(name): f"out since {entry['since']}: {entry['reason']}"
            for name, entry in kept["axes"].items()
            if since is None or datetime.fromisoformat(entry["since"]) > since
        }
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise UnusableInput(f"{path}: damaged ({type(error).__name__}: {error})") from None


def keep_out(machine: Machine, reasons: Mapping[str, str], since: datetime) -> str:
    """Keep axes out in later runs; what the operator should know of it.

    Args:
        machine: the host's.
        reasons: axis -> why.
        since: start of the run.

    Raises:
        StagectlError: the file cannot be written.
    """
    path = kept_in(machine)
    if path is None:
        return "the next run tries the observer again: there is no machine file to note it beside"
    axes = {}
    if path.exists():
        axes = json.loads(path.read_text(encoding="utf-8"))["axes"]
    for name, reason in reasons.items():
        axes[name] = {"since": since.isoformat(timespec="seconds"), "reason": reason}
    content = {"format": FORMAT, "version": VERSION, "axes": axes}
    write_atomically(path, json.dumps(content, indent=1, ensure_ascii=False) + "\n", "note")
    return (
        f"later runs do without the observer of {', '.join(axes)} ({path.name}) until the stage is "
        "measured: stagectl observer --measure"
    )
