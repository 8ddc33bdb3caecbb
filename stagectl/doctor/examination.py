"""All findings, in order."""

from __future__ import annotations

from collections.abc import Iterator

from stagectl.doctor.finding import Finding


def examine(seconds: float) -> Iterator[Finding]:
    """Examine this machine; nothing is changed, and no frame is sent on a CAN bus.

    Args:
        seconds: to measure jitter for.
    """
    from stagectl.doctor import buses, software, timing

    yield software.examine_kernels()
    yield timing.examine_scheduling()
    yield timing.examine_jitter(seconds)
    yield buses.examine_socketcan()
    yield buses.examine_kernel_sync()
    yield buses.examine_vcan()
    yield buses.examine_multicast()
    yield buses.examine_adapters()
    yield software.examine_postgres()
