"""Scripted drives that take setpoints of profile position (pp)."""

import pytest

NEW_SETPOINT, RELATIVE, ACKNOWLEDGED, REACHED = 1 << 4, 1 << 6, 1 << 12, 1 << 10
PP = 1


@pytest.fixture
def acknowledging(scripted):
    """Has all drives acknowledge, go to the target at once and report it reached.

    Returns what node 1 is sent: (controlword, target), each once.
    """

    def begin():
        words = []
        ends = {drive.node: drive.position for drive in scripted.drives}

        def on_sync(drive, count):
            word, target, offset = drive.latched
            drive.bits = ACKNOWLEDGED if word & NEW_SETPOINT else REACHED
            if drive.objects[0x6060, 0] != PP:
                ends[drive.node] = drive.position
            elif word & NEW_SETPOINT and not drive.controlword & NEW_SETPOINT:
                ends[drive.node] = target + (ends[drive.node] if word & RELATIVE else 0)
            if drive.objects[0x6060, 0] == PP:
                drive.latched = (word, ends[drive.node], offset)
            if drive.node == 1 and (not words or words[-1] != (word, target)):
                words.append((word, target))

        for drive in scripted.drives:
            drive.on_sync = on_sync
        return words

    return begin


@pytest.fixture
def stuck(scripted):
    """Has all drives stand where they are, whatever their target, and show neither bit."""

    def begin():
        def on_sync(drive, count):
            drive.bits = 0
            drive.latched = (drive.latched[0], drive.position, drive.latched[2])

        for drive in scripted.drives:
            drive.on_sync = on_sync

    return begin
