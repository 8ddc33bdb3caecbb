"""The records that the compiled plant has of an axis' ports, and the arena that they point into.

The arena is one flat float64 array with every table, list and extra state of all axes; the records
hold their offsets in it (-1: none). However many effects there are, a call of the kernel takes only
one more array.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stagedata import F64
from stagedata.fields import of_type

TABLES = (
    "position_force", "position_coulomb", "position_gain", "misreading", "velocity_force",
    "motor_loss", "time_force", "time_coulomb",
)  # fmt: skip
LISTS = ("harmonics", "decays", "hysteresis", "lags", "hanging", "bases", "fields")
"""Each with a count, such as `harmonics_count`."""
PORT_FIELDS = [
    ("ported", "?"),  # differs from the plain plant
    ("on_load", "?"),  # the encoder is on the part that hangs from the carriage
    ("coupled", "?"),  # the axes are solved jointly
    *of_type("f8", "gain", "saturation", "coulomb_forward", "coulomb_backward", "force", "spring"),
    ("load_friction", "f8"),  # factor on Fc per force transmitted to the load [1/N]
    ("motor_share", "f8"),  # of the mass, on the near side of the transmission
    ("mobility", "f8"),  # relative acceleration per force on the carriage [1/kg]
    *of_type("f8", "table_low", "table_inverse", "velocity_scale", "motor_scale", "time_inverse"),
    *of_type("i8", "table_count", "velocity_nodes", "time_count", *TABLES, *LISTS),
    *of_type("i8", *(f"{name}_count" for name in LISTS)),
    *of_type("i8", "history", "history_depth", "delay_ticks", "delay_share", "coupling"),
    # weights of a coarse step: `current_loop`
    *of_type("f8", *(f"{of}_{by}" for of in ("end", "mean", "early") for by in ("old", "start"))),
    ("coarse_share", "f8"),
]
"""Fields of the plant's record; integers without a count are offsets in the arena."""

PORT_STATE_FIELDS = [
    ("clock", "i8"),  # control ticks since t = 0
    ("ring", "i8"),  # index of the newest output in the history
    ("late", "f8"),  # delayed output before and after its step within this tick
    ("later", "f8"),
    ("place", "f8"),  # position about which this tick is linearised [m]
    ("coulomb", "f8"),
    ("coulomb_slope", "f8"),
    ("gain", "f8"),
    ("gain_slope", "f8"),
    ("pull", "f8"),
    ("pull_slope", "f8"),
    ("push", "f8"),  # force over time at the tick's start [N], and its rate [N/s]
    ("push_rate", "f8"),
    ("misread", "f8"),  # error of the encoder reading [m]
    ("misread_slope", "f8"),
    ("deflection", "f8"),  # of that part [m]
    ("net", "f8"),  # force on the carriage without coupling and springs [N]
    ("transmitted", "f8"),  # force through the transmission to the load [N]
    ("sprung", "f8"),  # force of the oscillators on it [N]
    ("springs", "f8"),  # acceleration by all springs and dampers [m/s^2]
    ("lost", "f8"),  # motor force that lags behind the measured one [N]
    ("response", "f8"),  # change of motor force per change of measured force
    ("rise", "f8"),  # of the motor force along the travel [N/m]
    ("kick", "f8"),  # change of velocity in this substep [m/s]
    ("lead", "f8"),  # velocity that a coarse step adds to its displacement [m/s]
]
"""Fields of the state's record."""


class Arena:
    """Collects arrays into one flat array."""

    def __init__(self) -> None:
        self._parts: list[F64] = []
        self._used = 0

    def add(self, values: F64 | Sequence[float] | Sequence[Sequence[float]] | None) -> int:
        """Append values; return their offset, -1 if there are none."""
        if values is None or len(values) == 0:
            return -1
        part = np.ascontiguousarray(values, dtype=np.float64).ravel()
        self._parts.append(part)
        self._used += len(part)
        return self._used - len(part)

    def array(self) -> F64:
        """The whole array, never empty, float64[n]."""
        return np.concatenate([*self._parts, np.zeros(1)])
