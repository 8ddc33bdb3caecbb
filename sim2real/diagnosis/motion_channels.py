"""The channels of a recording that is judged along its motion: what its force alone reveals.

Without a demand there is no law to compare a force with, but the motion that it made shows whether
it was logged late, and whether it lost its sign.
"""

from __future__ import annotations

from dataclasses import dataclass

from hil_sim.settings import StageSettings
from sim2real.audit import delay_finding, remove_delay
from sim2real.findings import ChannelFinding
from sim2real.open_loop import Motion, find_delay, has_lost_sign
from stagedata import Recording


@dataclass(frozen=True, slots=True, eq=False)
class MotionChannels:
    """The faults of a recording's forces.

    Attributes:
        findings: none of them marked as applied.
        recording: without the delays found.
    """

    findings: tuple[ChannelFinding, ...]
    recording: Recording

    def lost_sign(self) -> ChannelFinding | None:
        """The finding of a force without its sign, which nothing restores; or None."""
        return next((f for f in self.findings if f.finding == "sign"), None)


def audit_motion(recording: Recording, motion: Motion, settings: StageSettings) -> MotionChannels:
    """Audit the forces of a recording.

    Args:
        recording: as logged.
        motion: of it.
        settings: of the machine file; mass and friction may have any values.
    """
    findings = []
    for axis in settings.axes:
        if has_lost_sign(motion, axis.name, recording.axes[axis.name]):
            text = f"{axis.name}: force_actual has one sign while the motion reverses"
            findings.append(ChannelFinding(axis.name, "force_actual", "sign", None, "1", text=text))
            continue
        delay = find_delay(motion, axis)
        if delay is None:
            continue
        findings.append(delay_finding(axis.name, "force_actual", delay.value, motion.period))
        recording = remove_delay(recording, axis.name, "force_actual", delay.value, motion.period)
    return MotionChannels(tuple(findings), recording)
