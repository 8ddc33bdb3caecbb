"""What the watchdog of the observers has found, in words, and kept until the next measurement.

On a real stage an observer that fed an oscillation stays out in later runs, too: a small file
beside the machine file says so. A run on the virtual stage starts afresh.
"""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime

from estimation.observer import Finding, Kind
from stagectl.config.machine import Machine
from stagectl.store.axis_notes import AxisNotes


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


def read_out(machine: Machine, measured: str | None = None) -> dict[str, str]:
    """Axes whose observers are out since an earlier run, and why.

    Args:
        machine: the host's.
        measured: when the stage was measured, ISO 8601: what was found before counts no more.

    Raises:
        UnusableInput: the file is damaged.
    """

    def tell(entry: Mapping[str, str]) -> str | None:
        since, of = entry["since"], datetime.fromisoformat
        counts = measured is None or of(since) > of(measured)
        return f"out since {since}: {entry['reason']}" if counts else None

    return {name: why for name, why in _notes(machine).read(tell).items() if why is not None}


def keep_out(machine: Machine, reasons: Mapping[str, str], since: datetime) -> str:
    """Keep axes out in later runs; what the operator should know of it.

    Args:
        machine: the host's.
        reasons: axis -> why.
        since: start of the run.

    Raises:
        StagectlError: the file cannot be written.
    """
    notes = _notes(machine)
    if notes.path is None:
        return "the next run tries the observer again: there is no machine file to note it beside"
    start = since.isoformat(timespec="seconds")
    notes.add({name: {"since": start, "reason": reason} for name, reason in reasons.items()})
    return (
        f"later runs do without the observer of {', '.join(notes.read(dict))} ({notes.path.name}) "
        "until the stage is measured: stagectl observer --measure"
    )


def _notes(machine: Machine) -> AxisNotes:
    return AxisNotes(machine.source, "observer-out")
