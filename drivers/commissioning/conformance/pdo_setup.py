"""Saves and restores communication and mapping parameters of a PDO.

All are read before any is changed: while the count is 0, some drives show no entries or lose them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from canopen import SdoAbortedError

from drivers.commissioning.conformance.probe import Probe

INVALID = 1 << 31
ENTRIES = 8
"""Most that a mapping of whole bytes can have."""


@dataclass(frozen=True, slots=True)
class PdoSetup:
    """A PDO's parameters.

    Attributes:
        communication, mapping: indices of its records.
        cob_id, kind: sub-indices 1 and 2 of the former.  entries: of the latter.
        spare: entries beyond their number, which have no effect, as far as the drive shows them.
    """

    communication: int
    mapping: int
    cob_id: int
    kind: int
    entries: tuple[int, ...]
    spare: tuple[int, ...]

    @classmethod
    def read(cls, probe: Probe, communication: int) -> PdoSetup:
        """The parameters in the drive; raises as `Probe.read`."""
        mapping = communication + 0x200
        count = probe.read(mapping, 0)
        return cls(
            communication,
            mapping,
            probe.read(communication, 1),
            probe.read(communication, 2),
            tuple(probe.read(mapping, sub) for sub in range(1, count + 1)),
            tuple(_spare(probe, mapping, count)),
        )

    def restore(self, probe: Probe) -> str:
        """Restores the parameters where they differ; returns what the drive did not accept."""
        if PdoSetup.read(probe, self.communication) == self:
            return ""
        steps = [
            (self.communication, 1, self.cob_id | INVALID),
            (self.mapping, 0, 0),
            *((self.mapping, sub, v) for sub, v in enumerate(self.entries + self.spare, start=1)),
            (self.mapping, 0, len(self.entries)),
            (self.communication, 2, self.kind),
            (self.communication, 1, self.cob_id),
        ]
        for step in steps:
            probe.abort_code(lambda s=step: probe.write(*s))  # type: ignore[misc]
        held = PdoSetup.read(probe, self.communication)
        if replace(held, spare=self.spare) == self:
            return ""
        return f"0x{self.communication:04X} has {held.text()}, had {self.text()}"

    def text(self) -> str:
        """The parameters on one line."""
        entries = " ".join(f"{entry:08X}" for entry in self.entries) or "nothing"
        return f"COB-ID 0x{self.cob_id:08X}, type {self.kind}, {entries} mapped"


def _spare(probe: Probe, mapping: int, count: int) -> Iterator[int]:
    try:
        for sub in range(count + 1, ENTRIES + 1):
            yield probe.read(mapping, sub)
    except SdoAbortedError:
        return


def restore_pdos(probe: Probe, *communication: int) -> None:
    """Has `Probe.restore` restore these PDOs (index 0x14xx or 0x18xx); raises as `Probe.read`."""
    for index in communication:
        setup = PdoSetup.read(probe, index)
        probe.on_restore(lambda s=setup: s.restore(probe))  # type: ignore[misc]
