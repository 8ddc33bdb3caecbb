"""What a virtual drive does otherwise than CiA 301 and 402 ask, as drives that are sold do.

A setting per habit; `Habits()` is a drive without. `habitual_objects` makes them of its object
dictionary; what acts on the bus or in a mode asks for its own.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Interval

from stagedata.ranges import Positive, Whole, check_ranges

CSP = 8
"""Value of 0x6060 that selects csp (CiA 402)."""
Values = tuple[tuple[int, int], ...]
"""Objects (index << 8 | sub-index), and a value of each."""


@dataclass(frozen=True, slots=True)
class Habits:
    """Of one drive.

    Attributes:
        absent: objects that it lacks.
        values: of objects after power-on.
        only: objects that take this value alone; it is theirs after power-on.
        limits: objects, and the lowest and highest value that they take.
        silent: objects that keep their value without a word.
        modes: values of 0x6060 that it takes; none: all that the virtual drive has.
        csp_mode: value of 0x6060 that selects csp.
        rated_force_unit: one count of 0x6076 [N].
        force_factor: one count of 0x60B2 and 0x6077 over 1/1000 of the rated force.
        wide: objects of 32 bits in place of 16.
        pdo_entries: most objects in a PDO; 0: as many as CiA 301 allows.
        tpdos: how many it has; 0: as the virtual drive.
        long_answers: SDO answers have four bytes, however short the object.
        homing_attained: whether statusword bit 12 confirms homing.
        in_sync: statusword bit 8 is set while the bus reaches the drive.
        interpolates: csp runs in a straight line from setpoint to setpoint, else it steps.
    """

    absent: tuple[int, ...] = ()
    values: Values = ()
    only: Values = ()
    limits: tuple[tuple[int, int, int], ...] = ()
    silent: tuple[int, ...] = ()
    modes: tuple[int, ...] = ()
    csp_mode: Annotated[int, Interval(ge=-128, le=127)] = CSP
    rated_force_unit: Positive = 1e-3
    force_factor: Positive = 1.0
    wide: tuple[int, ...] = ()
    pdo_entries: Whole = 0
    tpdos: Whole = 0
    long_answers: bool = False
    homing_attained: bool = True
    in_sync: bool = False
    interpolates: bool = True

    def __post_init__(self) -> None:
        check_ranges(self)

    def mode(self, value: int) -> int | None:
        """The mode of CiA 402 that a value of 0x6060 selects; None: it takes no such value."""
        if value and self.modes and value not in self.modes:
            return None
        if value == self.csp_mode:
            return CSP
        return None if value == CSP else value
