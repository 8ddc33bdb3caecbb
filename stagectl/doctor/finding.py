"""One thing that a machine offers or lacks."""

from __future__ import annotations

from dataclasses import dataclass

NAMES = (
    "kernels", "real-time", "jitter", "socketcan", "kernel-sync", "vcan", "udp-multicast",
    "adapters", "postgres",
)  # fmt: skip
"""Of all findings, in order."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing.

    Attributes:
        name: one of `NAMES`.
        available: whether it can be used.
        found: what there is, in words.
        remedy: how to get what is missing; empty if nothing is.
    """

    name: str
    available: bool
    found: str
    remedy: str = ""
