"""The channels of a recording that is judged along its motion: what its force alone reveals.

Without a demand there is no law to compare a force with, but the motion that it made shows whether
it was logged late, and whether it lost its sign.
"""

from __future__ import annotations

from hil_sim.settings import StageSettings
from sim2real.audit import delay_finding, remove_delay
from sim2real.findings import ChannelFinding
from sim2real.open_loop import Motion, find_delay, has_lost_sign
from stagedata import Recording


def audit_motion(
    recording: Recording, motion: Motion, settings: StageSettings
) -> tuple[list[ChannelFinding], Recording]:
    """The faults of a recording's forces, and the recording without the delays found.

    A force without its sign ("sign") cannot be corrected for.

    Args:
        recording: as logged.
        motion: of it.
        settings: of the machine file; mass and friction may have any values.
    """
    findings = []
    for axis in settings.axes:
        if has_lost_sign(motion, axis, recording.axes[axis.name]):
            text = f"{axis.name}: force_actual has one sign while the motion reverses"
            findings.append(ChannelFinding(axis.name, "force_actual", "sign", None, "1", text=text))
            continue
        delay = find_delay(motion, axis)
        if delay is None:
            continue
        findings.append(delay_finding(axis.name, "force_actual", delay.value, motion.period))
        recording = remove_delay(recording, axis.name, "force_actual", delay.value, motion.period)
    return findings, recording
