"""The mode of operation of a drive (0x6060, 0x6061), which may change at any time.

A mode that is changed in motion brakes with 0x6084; the new one begins there.
"""

from __future__ import annotations

from collections.abc import Callable

from hil_sim.cia301 import require
from hil_sim.cia402 import objects as o
from hil_sim.cia402.demand import DemandSource
from hil_sim.cia402.homing import Homing
from hil_sim.cia402.modes import Context, CyclicPosition, CyclicTorque, Mode, ModeCode
from hil_sim.cia402.profile_position import ProfilePosition
from hil_sim.cia402.velocity import CyclicVelocity, ProfileVelocity

_MODES: dict[int, type[Mode]] = {
    ModeCode.NONE: Mode,
    ModeCode.PROFILE_POSITION: ProfilePosition,
    ModeCode.PROFILE_VELOCITY: ProfileVelocity,
    ModeCode.HOMING: Homing,
    ModeCode.CYCLIC_POSITION: CyclicPosition,
    ModeCode.CYCLIC_VELOCITY: CyclicVelocity,
    ModeCode.CYCLIC_TORQUE: CyclicTorque,
}


class ModeSelector:
    """Holds one object per mode and the current one.

    Args:
        context: what the modes work on.
        demand: moves the demand.
        is_active: whether the mode acts: OPERATION ENABLED, and not stopping to leave it.
        on_change: called after a change of mode.

    Attributes:
        current: the mode selected.
    """

    def __init__(
        self,
        context: Context,
        demand: DemandSource,
        is_active: Callable[[], bool],
        on_change: Callable[[], None],
    ) -> None:
        self._context = context
        self._demand = demand
        self._is_active = is_active
        self._on_change = on_change
        self._habits = context.motor.settings.habits
        self._modes = {code: mode(context) for code, mode in _MODES.items()}
        self.current = self._modes[ModeCode.NONE]
        context.dictionary.check[o.MODE] = self._check
        context.dictionary.on_write[o.MODE] = self._select

    def reset(self) -> None:
        """Return to mode 0; the dictionary has been reset already."""
        self.current = self._modes[ModeCode.NONE]

    def _check(self, value: int) -> None:
        require(self._habits.mode(value) in self._modes)

    def _select(self, value: int) -> None:
        code = self._habits.mode(value)
        assert code is not None  # noqa: S101  `_check` has taken it
        old, new = self.current, self._modes[code]
        if new is old:
            return
        self.current = new
        values = self._context.dictionary.values
        if self._is_active():
            if self._demand.following:
                self._demand.take_over(old.velocity())
            self._demand.generator.stop(self._context.rate(o.PROFILE_DECELERATION))
            values[o.TORQUE_OFFSET] = 0
            new.halted = old.halted
            new.start()
        else:
            new.bits = 0
            new.halted = False
        values[o.MODE_DISPLAY] = value
        self._on_change()
