"""Errors of the virtual drive: EMCY messages, error register, error history, error code.

0x1001 and 0x603F show the errors that are present, 0x1003 keeps the newest eight, newest first.
EMCY inhibit time (0x1015) is not supported.
"""

from __future__ import annotations

import struct
from collections.abc import Callable

from canopen.sdo import constants as abort

from hil_sim.cia301.object_dictionary import Dictionary, key, require
from hil_sim.ports import CanSegment

CONNECTION_ABORTED = 0x8100  # NMT stopped or reset while enabled
HEARTBEAT_LOST = 0x8130
FOLLOWING_ERROR = 0x8611
SYNC_LENGTH = 0x8240
RPDO_TIMEOUT = 0x8250  # setpoints missing
OVER_CURRENT = 0x2310  # of the drive's output
OVER_VOLTAGE = 0x3210  # of the DC link, as by regenerative braking
UNDER_VOLTAGE = 0x3220  # of the DC link
OVER_TEMPERATURE = 0x4310  # of the drive
HARDWARE = 0x5000  # of the device
ENCODER_LOST = 0x7305
OVER_TRAVEL = 0x8612  # beyond the reference limits

COASTING_FAULTS = frozenset({OVER_CURRENT, OVER_VOLTAGE, UNDER_VOLTAGE, HARDWARE, ENCODER_LOST})
"""Faults in which the drive cannot brake: the force goes off at once."""

_REGISTER, _COB_ID, _ERROR_CODE = key(0x1001), key(0x1014), key(0x603F)
_HISTORY = key(0x1003)
_HISTORY_LENGTH = 8
_EMCY = struct.Struct("<HB5x")
_GENERIC, _COMMUNICATION, _PROFILE = 1 << 0, 1 << 4, 1 << 5
_CLASS_BITS = {0x2: 1 << 1, 0x3: 1 << 2, 0x4: 1 << 3}  # current, voltage, temperature


def register_bits(code: int) -> int:
    """Error register bits of an error code: the generic one and that of its class."""
    if code >> 8 in (0x81, 0x82):
        return _GENERIC | _COMMUNICATION
    return _GENERIC | _CLASS_BITS.get(code >> 12, _PROFILE)


class Emergency:
    """Keeps and announces errors.

    Args:
        can_send: whether the NMT state allows an EMCY now.
    """

    def __init__(
        self, dictionary: Dictionary, segment: CanSegment, can_send: Callable[[], bool]
    ) -> None:
        self._dictionary = dictionary
        self._segment = segment
        self._can_send = can_send
        self._present: list[int] = []
        dictionary.check[_HISTORY] = lambda value: require(not value)
        dictionary.on_write[_HISTORY] = lambda _: self.clear_history()
        dictionary.check[_COB_ID] = self._check_cob
        for n in range(1, _HISTORY_LENGTH + 1):
            dictionary.live[_HISTORY + n] = lambda n=n: self._read_history(n)  # type: ignore[misc]

    def announce(self, code: int) -> None:
        """Announce an error that passes by itself: EMCY and history."""
        self._append_history(code)
        self._send(code, self._dictionary.integer(_REGISTER) | register_bits(code))

    def raise_(self, code: int) -> None:
        """Announce an error that is present until `clear`."""
        if code not in self._present:
            self._present.append(code)
        self._append_history(code)
        self._update_objects()
        self._send(code, self._dictionary.integer(_REGISTER))

    def clear(self, code: int | None = None) -> None:
        """Clear an error (None: all), announced by EMCY 0x0000."""
        before = len(self._present)
        self._present = [c for c in self._present if code is not None and c != code]
        if len(self._present) != before:
            self._update_objects()
            self._send(0x0000, self._dictionary.integer(_REGISTER))

    def reset(self) -> None:
        """Clear all errors without an EMCY, as at power-on."""
        self._present = []
        self._update_objects()

    def clear_history(self) -> None:
        """Empty 0x1003."""
        for n in range(_HISTORY_LENGTH + 1):
            self._dictionary.values[_HISTORY + n] = 0

    def _update_objects(self) -> None:
        register = 0
        for code in self._present:
            register |= register_bits(code)
        self._dictionary.values[_REGISTER] = register
        self._dictionary.values[_ERROR_CODE] = self._present[-1] if self._present else 0

    def _append_history(self, code: int) -> None:
        values = self._dictionary.values
        for n in range(_HISTORY_LENGTH, 1, -1):
            values[_HISTORY + n] = values[_HISTORY + n - 1]
        values[_HISTORY + 1] = code
        values[_HISTORY] = min(self._dictionary.integer(_HISTORY) + 1, _HISTORY_LENGTH)

    def _send(self, code: int, register: int) -> None:
        cob = self._dictionary.integer(_COB_ID)
        if self._can_send() and not cob >> 31:
            self._segment.emit(cob & 0x7FF, _EMCY.pack(code, register))

    def _read_history(self, number: int) -> int:
        require(number <= self._dictionary.integer(_HISTORY), abort.ABORT_NO_DATA_AVAILABLE)
        return self._dictionary.integer(_HISTORY + number)

    def _check_cob(self, value: int) -> None:
        require(not value & 0x7FFFF800 and (value >> 31 or 0x081 <= value <= 0x57F))
