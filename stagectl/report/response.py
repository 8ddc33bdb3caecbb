"""The page of a measurement: Bode plots of the responses, Nyquist plots of the observers' loops."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from estimation.observer import Design
from estimation.response import FrequencyResponse, Lines
from stagectl.config.machine import Machine
from stagectl.config.settings.observer import believed_figures, clocking
from stagectl.measurement import AxisFindings, Measurement
from stagectl.report.chart import Chart, Curve, legend
from stagectl.report.outline import Outline
from stagectl.report.render import render_page
from stagectl.store import write_atomically

_NEAR = 1.6
"""Part of the Nyquist plane that is drawn: that many either side of the origin."""


def write_response_page(
    path: Path,
    machine: Machine,
    measurement: Measurement,
    designs: Mapping[str, Design | str],
    findings: Mapping[str, AxisFindings],
) -> None:
    """Write the page of a measurement, atomically.

    Args:
        path: of the HTML file; an existing one is replaced.
        machine: as the host believes it.
        measurement: of its stage.
        designs: axis -> its observer by that measurement, or why it has none.
        findings: axis -> what its response shows.

    Raises:
        StagectlError: the file cannot be written.
    """
    facts = {
        "Measured": (measurement.measured or "on a virtual stage").replace("T", " "),
        "Machine file": machine.source,
    }
    outline = Outline("Responses", machine.name, (), "", facts=facts)
    axes = [
        _axis(name, machine, measurement, designs[name], found) for name, found in findings.items()
    ]
    key = legend("measured", ("before", "machine file"))
    page = render_page("response.html.j2", outline, axes=axes, legend=key)
    write_atomically(path, page, "page")


def _axis(
    name: str, machine: Machine, measurement: Measurement, design: Design | str, found: AxisFindings
) -> dict[str, Any]:
    response = measurement.axes[name].response
    judged: dict[str, Any] = {
        "observer": design,
        "gain": "-",
        "margin": "-",
        "peak": "-",
        "nyquist": None,
    }
    if isinstance(design, Design):
        judged |= {"observer": "on", "gain": f"{design.gain:.3g}", "nyquist": _nyquist(design)}
        if design.margins is not None:
            margins = design.margins
            judged |= {"margin": f"{margins.gain:.2f}", "peak": f"{margins.peak:.2f}"}
    return {
        "name": name,
        "contradictions": found.contradictions,
        "plots": [
            *_bode(machine, name, response.rest, found, slides=False),
            *_bode(machine, name, response.sliding, found, slides=True),
        ],
        **judged,
    }


def _bode(
    machine: Machine, name: str, state: FrequencyResponse, found: AxisFindings, slides: bool
) -> Iterator[tuple[str, Chart]]:
    """Magnitude and phase of both responses, measured and by the file."""
    axis = machine.axes[name]
    figures = believed_figures(axis, axis.plant.friction.figures)
    clock = clocking(axis.drive, machine.bus.sync_period)
    offset_sign = found.fitted.figures.sign
    for which, what, at, value, sign, unit in (
        (0, "force offset", state.offset_at, state.offset, offset_sign, "m/N"),
        (1, "demand", state.demand_at, state.demand, 1.0, "m/m"),
    ):
        file = Lines(at, clock).responses(figures, slides)[which]
        size = [Curve("measured", at, np.abs(value)), Curve("before", at, np.abs(file))]
        phase = [
            Curve("measured", at, _degrees(value, sign)),
            Curve("before", at, _degrees(file, 1.0)),
        ]
        label = f"position by {what}, {'while sliding' if slides else 'at rest'}"
        yield label, Chart(size, "frequency, Hz", f"magnitude, {unit}", log="xy")
        yield label, Chart(phase, "frequency, Hz", "phase, degrees", log="x")


def _degrees(value: Any, sign: float) -> Any:
    turned = np.degrees(np.unwrap(np.angle(value)))
    first = turned[0] - (0.0 if sign > 0.0 else 180.0)
    return turned - 360.0 * round(first / 360.0)


def _nyquist(design: Design) -> Any:
    """The loop closed at SYNC, with -1 and the circle of peak sensitivity 2 about it."""
    measured = design.figures.measured
    if measured is None:
        return None
    curves = []
    for loop in measured.loops(design.model, design.gain):
        inside = np.abs(loop) < _NEAR
        curves.append(Curve("measured", loop.real[inside], loop.imag[inside]))
    turn = np.linspace(0.0, 2.0 * math.pi, 90)
    curves.append(Curve("floor", -1.0 + 0.5 * np.cos(turn), 0.5 * np.sin(turn)))
    curves.append(Curve("before", np.array([-1.0]), np.array([0.0]), has_line=False))
    return Chart(curves, "real part", "imaginary part")
