"""Cyclic synchronous torque (cst): the force itself is the setpoint, without a position loop.

At each SYNC the sum of target torque (0x6071) and torque offset (0x60B2), within max torque
(0x6072), acts at once; bit 12 says that the drive follows the command value. Halt, quick stop or
another mode closes the position loop where the axis is.
"""

from __future__ import annotations

from hil_sim.cia402 import objects as o
from hil_sim.cia402.modes import INTERNAL_LIMIT, MODE_BIT_12, CyclicPosition


class CyclicTorque(CyclicPosition):
    """cst (10)."""

    def velocity(self) -> float:
        """Velocity of the axis [m/s]: no demand is moving."""
        if self.halted:
            return super().velocity()
        motor = self.context.motor
        return motor.velocity() * motor.speed_unit

    def on_sync(self) -> None:
        """Take over the force of this SYNC."""
        if self.halted:
            return
        wanted = self.integer(o.TARGET_TORQUE) + self.integer(o.TORQUE_OFFSET)
        force = min(max(wanted, -self._force_limit), self._force_limit)
        self.context.motor.command_force(force)
        bits = MODE_BIT_12 if force == wanted else INTERNAL_LIMIT
        self.set_bits(bits)
