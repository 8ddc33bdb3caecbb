"""Holding brake of an axis, as the drive tells and commands it (0x60FE, bit 0).

The drive sets it with the force off and releases it under power. Without power the host may release
it, to move the axis by hand: bit 0 of 0x60FE:02 takes it over, bit 0 of 0x60FE:01 is then what it
does, until the axis is enabled. Under power nobody sets it: that is refused.

It is told, not felt: the mechanics without force rest by their friction.
"""

from __future__ import annotations

from collections.abc import Callable

from canopen import SdoAbortedError
from canopen.sdo import constants as abort

from hil_sim.cia301 import Dictionary
from hil_sim.cia402 import objects as o

_SET = 1


class Brake:
    """The brake of one drive.

    Args:
        dictionary: of the drive.
        powered: whether there is, or may be, force.
    """

    def __init__(self, dictionary: Dictionary, powered: Callable[[], bool]) -> None:
        self._dictionary = dictionary
        self._powered = powered
        dictionary.live[o.OUTPUTS] = self.outputs
        dictionary.check[o.OUTPUTS] = self._check

    def outputs(self) -> int:
        """0x60FE:01 as it is."""
        integer = self._dictionary.integer
        if self._powered():
            return 0
        return integer(o.OUTPUTS) & _SET if integer(o.OUTPUT_MASK) & _SET else _SET

    def take_back(self) -> None:
        """The axis is being enabled: the brake is the drive's own again."""
        values = self._dictionary.values
        values[o.OUTPUT_MASK] = self._dictionary.integer(o.OUTPUT_MASK) & ~_SET

    def _check(self, value: int) -> None:
        if value & _SET and self._powered():
            raise SdoAbortedError(abort.ABORT_APPLICATION_DEVICE_STATE)
