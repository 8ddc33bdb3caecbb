"""Texts of error codes (EMCY, 0x603F): CiA 301 table 26 and CiA 402-1.

A code that is not listed is described by its class: the high byte, else the high digit.
"""

from __future__ import annotations

ERROR_TEXTS: dict[int, str] = {
    0x0000: "no error",
    0x1000: "generic error",
    0x2110: "short circuit or earth leakage (input)",
    0x2120: "earth leakage",
    0x2130: "short circuit",
    0x2220: "continuous over-current",
    0x2310: "continuous over-current (output)",
    0x2320: "short circuit or earth leakage (output)",
    0x2350: "load level fault (I2t, thermal state)",
    0x3110: "mains over-voltage",
    0x3120: "mains under-voltage",
    0x3210: "DC link over-voltage",
    0x3220: "DC link under-voltage",
    0x4210: "excess device temperature",
    0x4310: "excess drive temperature",
    0x4410: "excess motor temperature",
    0x5113: "low voltage supply",
    0x5441: "contacts: emergency stop",
    0x5530: "non-volatile memory",
    0x6010: "software reset (watchdog)",
    0x6320: "parameter error",
    0x7121: "motor blocked",
    0x7122: "motor error or commutation malfunction",
    0x7300: "sensor",
    0x7305: "incremental sensor 1 fault",
    0x7306: "incremental sensor 2 fault",
    0x7310: "speed",
    0x7320: "position",
    0x7500: "communication (internal)",
    0x8110: "CAN overrun, objects lost",
    0x8120: "CAN in error passive mode",
    0x8130: "heartbeat or life guard error: the drive lost its host",
    0x8140: "recovered from bus off",
    0x8150: "CAN-ID collision",
    0x8210: "PDO not processed due to length error",
    0x8220: "PDO length exceeded",
    0x8240: "unexpected SYNC data length",
    0x8250: "RPDO timeout: setpoints missing",
    0x8311: "excess force or torque",
    0x8400: "velocity (speed) control",
    0x8480: "excess velocity difference",
    0x8500: "position control",
    0x8600: "positioning control",
    0x8611: "following error: the axis left its window",
    0x8612: "reference (soft) limit",
    0x8613: "homing error",
    0x9000: "external error",
    0xFF00: "manufacturer specific",
}

_CLASSES: dict[int, str] = {
    0x2: "current",
    0x3: "voltage",
    0x4: "temperature",
    0x5: "device hardware",
    0x6: "device software",
    0x7: "additional modules",
    0x8: "monitoring",
    0x9: "external error",
    0xF: "additional functions or manufacturer specific",
}

ERROR_REGISTER_BITS: tuple[str, ...] = (
    "generic", "current", "voltage", "temperature",
    "communication", "device profile", "reserved", "manufacturer",
)  # fmt: skip
"""Meaning of the bits of 0x1001, from bit 0."""


def error_text(code: int) -> str:
    """The meaning of an error code, followed by the code itself."""
    text = ERROR_TEXTS.get(code) or ERROR_TEXTS.get(code & 0xFFF0) or ERROR_TEXTS.get(code & 0xFF00)
    if text is None:
        text = _CLASSES.get(code >> 12, "unknown error")
    return f"{text} (0x{code:04X})"


def register_text(register: int) -> str:
    """The bits set in the error register 0x1001, in words; "none" where it is 0."""
    return ", ".join(t for i, t in enumerate(ERROR_REGISTER_BITS) if register >> i & 1) or "none"
