"""Holding brake of an axis, as the drive reports and controls it (0x60FE, bit 0).

The drive applies it while the force is off and releases it under power. Without power the host may
release it, to move the axis by hand: bit 0 of 0x60FE:02 selects the output, bit 0 of 0x60FE:01 then
sets it, until the axis is enabled. Applying it under power is refused.

Only the output is simulated; the mechanics without force are held by their friction.
"""

from __future__ import annotations

from collections.abc import Callable

from canopen.sdo import constants as abort

from hil_sim.cia301 import Dictionary, require
from hil_sim.cia402 import objects as o

_SET = 1


class Brake:
    """The brake of one drive.

    Args:
        dictionary: of the drive.
        is_powered: whether the force is, or may be, on.
    """

    def __init__(self, dictionary: Dictionary, is_powered: Callable[[], bool]) -> None:
        self._dictionary = dictionary
        self._is_powered = is_powered
        dictionary.live[o.OUTPUTS] = self.outputs
        dictionary.check[o.OUTPUTS] = self._check

    def outputs(self) -> int:
        """0x60FE:01, bit 0 set while the brake is applied."""
        integer = self._dictionary.integer
        if self._is_powered():
            return 0
        return integer(o.OUTPUTS) & _SET if integer(o.OUTPUT_MASK) & _SET else _SET

    def take_control(self) -> None:
        """Take the brake back from the host: the axis is being enabled."""
        values = self._dictionary.values
        values[o.OUTPUT_MASK] = self._dictionary.integer(o.OUTPUT_MASK) & ~_SET

    def _check(self, value: int) -> None:
        powered = self._is_powered()
        require(not value & _SET or not powered, abort.ABORT_APPLICATION_DEVICE_STATE)
