"""Measuring the stage and checking its drives, on request."""

from __future__ import annotations

from dataclasses import asdict
from datetime import UTC, datetime
from typing import Any

from drivers.canopen import LISTENING, Network, open_bus
from drivers.commissioning.conformance import run as check_conformance
from drivers.settings import AxisSettings, BusSettings
from drivers.stage import Stage
from stagectl.config.machine import Machine
from stagectl.errors import Aborted
from stagectl.measurement import check_scale, measure_stage
from stagectl.server.handover import Handover


def measure(stage: Stage, machine: Machine, simulated: bool, agreed: bool) -> dict[str, Any]:
    """Home the stage, measure how its axes respond, and hold it.

    Args:
        stage: booted.
        machine: as the host believes it.
        simulated: on virtual drives, whose measurement has no date.
        agreed: else it is only said what the axes will do.

    Returns:
        `does`: lines of what each axis will do; or `measurement`: text of a response file.
    """
    lines: list[str] = []

    def ask(does: list[str]) -> bool:
        lines.extend(does)
        return agreed

    stage.require_csp()
    stage.home()
    stage.enable()
    now = None if simulated else datetime.now(UTC).astimezone()
    try:
        return {"measurement": measure_stage(stage, machine, now, ask).as_text()}
    except Aborted:
        if agreed:
            raise
        return {"does": lines}


def check_drive(
    bus: BusSettings, handover: Handover, node: int, power: bool, homing: bool
) -> dict[str, Any]:
    """Test a drive against CiA 301 and CiA 402, on a bus that nothing else uses.

    Returns:
        `found`: the findings, as dictionaries.
    """
    opened = open_bus(bus)
    try:
        network = Network(opened, str(bus), handover.frame, beats=False)
        network.watchers.append(lambda _: handover.stop.check())
        network.listen(LISTENING)  # refuses a bus on which another host is active
        findings = check_conformance(network, node, power=power, homing=homing)
        network.disconnect()
    finally:
        opened.shutdown()
    return {"found": [{**asdict(each), "verdict": str(each.verdict)} for each in findings]}


def check_move(
    bus: BusSettings, handover: Handover, axis: AxisSettings, machine: Machine
) -> dict[str, Any]:
    """Move an axis by 0.1 mm and back, and compare scale and sign with what was asked.

    Returns:
        `found`: what was compared, as dictionaries.
    """
    with Stage.open(bus, (axis,), tap=handover.frame) as stage:
        stage.interrupt = handover.stop.check
        stage.boot()
        compared = check_scale(stage, stage.axes[0], machine)
        stage.disable()
    return {"found": [asdict(each) for each in compared]}
