"""The page of a measurement: Bode plots of the responses, Nyquist plots of the observers' loops."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from estimation.observer import Design
from estimation.response import FrequencyResponse, Lines
from stagectl.config.machine import Axis, Machine
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
    text = render_page(
        "response.html.j2",
        outline,
        axes=[
            _axis(name, machine, measurement, designs[name], found)
            for name, found in findings.items()
        ],
        legend=legend("measured", ("before", "machine file")),
    )
    write_atomically(path, text, "page")


def _axis(
    name: str,
    machine: Machine,
    measurement: Measurement,
    design: Design | str,
    found: AxisFindings,
) -> dict[str, Any]:
    axis, period = machine.axes[name], machine.bus.sync_period
    response = measurement.axes[name].response
    plots = []
    for state, title, slides in (
        (response.rest, "at rest", False),
        (response.sliding, "while sliding", True),
    ):
        plots += _bode(axis, period, state, title, slides, found)
    is_on = isinstance(design, Design)
    return {
        "name": name,
        "contradictions": found.contradictions,
        "observer": "on" if is_on else design,
        "gain": f"{design.gain:.3g}" if isinstance(design, Design) else "-",
        "margin": _margin(design, "gain"),
        "peak": _margin(design, "peak"),
        "plots": plots,
        "nyquist": _nyquist(design) if isinstance(design, Design) else None,
    }


def _margin(design: Design | str, which: str) -> str:
    margins = None if isinstance(design, str) else design.margins
    return "-" if margins is None else f"{getattr(margins, which):.2f}"


def _bode(
    axis: Axis,
    period: float,
    state: FrequencyResponse,
    title: str,
    slides: bool,
    found: AxisFindings,
) -> list[tuple[str, Any]]:
    """Magnitude and phase of both responses, measured and by the file."""
    plots = []
    for which, (at, value, unit) in enumerate(
        (
            (state.offset_at, state.offset, "m/N"),
            (state.demand_at, state.demand, "m/m"),
        )
    ):
        figures = believed_figures(axis, axis.plant.friction.figures)
        file = Lines(at, clocking(axis.drive, period)).responses(figures, slides)[which]
        what = ("force offset", "demand")[which]
        size = [Curve("measured", at, np.abs(value)), Curve("before", at, np.abs(file))]
        phase = [
            Curve(
                "measured", at, _degrees(value, found.fitted.figures.sign if which == 0 else 1.0)
            ),
            Curve("before", at, _degrees(file, 1.0)),
        ]
        label = f"position by {what}, {title}"
        plots.append((label, Chart(size, "frequency, Hz", f"magnitude, {unit}", log="xy")))
        plots.append((label, Chart(phase, "frequency, Hz", "phase, degrees", log="x")))
    return plots


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
