"""The rms of what a model leaves by phase of motion, position, velocity, time and frequency.

Values are in µm, N, mm and mm/s; of an axis that turns in µrad, N m, mrad and mrad/s. `before` is
the machine file as given, `after` the model with the causes found, `floor` one noisy run of the
model minus its noise-free run.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from hil_sim.settings import AxisSettings
from sim2real.findings import OVER, SHOWN_AS, Unlisted
from sim2real.gap import Measured, Signals
from sim2real.phases import PHASES, REST, SETTLING, split_phases
from stagectl.report.chart import Chart, Curve
from stagectl.report.formats import digits
from stagectl.report.outline import Table
from stagedata import F64, aligned_demand

_BINS = 40
_MIN_SAMPLES = 8  # in a bin that is drawn
_SEGMENT = 1024  # samples, of the spectrum


@dataclass(frozen=True, slots=True)
class Panel:
    """A chart with its heading."""

    title: str
    picture: Chart | Markup


@dataclass(frozen=True, slots=True)
class Section:
    """Charts of one signal of one axis.

    Attributes:
        axis, signal: which ones.
        share: of the gap's energy above the floor.
        phases: residual by phase of motion.
        panels: residual over position, velocity, time, spectrum.
    """

    axis: str
    signal: str
    share: float
    phases: Table
    panels: Sequence[Panel]


def residual_section(
    measured: Sequence[Measured],
    explained: Sequence[Signals] | None,
    settings: AxisSettings,
    signal: str,
    share: float,
    ratio: float,
) -> Section:
    """Residual of one signal of one axis by phase, position, velocity, time and frequency.

    Args:
        measured: the gap of each recording.
        explained: signals of the model with the causes, per recording; None without causes.
        settings: of the axis.
        signal: "position" or "force".
        share: of the gap's energy above the floor.
        ratio: Tc/Ts.
    """
    axis = settings.name
    scale, unit = SHOWN_AS[measured[0].gap[axis][signal].unit]
    kinds: dict[str, list[F64]] = {"before": [], "after": [], "floor": []}
    by: dict[str, list[F64]] = {"phase": [], "position": [], "velocity": [], "time": []}
    valid = []
    for r, m in enumerate(measured):
        of_axis = m.replay.recording.axes[axis]
        phases = split_phases(of_axis.position_demand, m.replay.period)
        kinds["before"].append(scale * m.residual[axis][signal])
        kinds["floor"].append(scale * m.floor.draws[0][axis][signal])
        if explained is not None:
            residual = m.replay.measured()[axis][signal] - explained[r][axis][signal]
            kinds["after"].append(np.asarray(scale * residual, dtype=np.float64))
        by["phase"].append(phases.phase.astype(np.float64))
        by["position"].append(1e3 * aligned_demand(of_axis, ratio))
        by["velocity"].append(1e3 * phases.velocity)
        by["time"].append(np.asarray(m.replay.place * m.replay.period, dtype=np.float64))
        valid.append(of_axis.valid)
    counted = np.concatenate(valid)
    residuals = {k: np.concatenate(v)[counted] for k, v in kinds.items() if v}
    places = {k: np.concatenate(v)[counted] for k, v in by.items()}
    panels = _panels(residuals, places, settings, unit, measured[0].replay.period)
    return Section(axis, signal, share, _by_phase(places["phase"], residuals, unit), panels)


def _panels(
    residuals: dict[str, F64],
    places: dict[str, F64],
    settings: AxisSettings,
    unit: str,
    period: float,
) -> list[Panel]:
    """Rms over position, velocity and time, and the spectrum."""
    moving = (places["phase"] != REST) & (places["phase"] != SETTLING)
    label = f"rms [{unit}]"
    panels = []
    for name, x_label in (
        ("position", f"position [{settings.unit_of('mm')}]"),
        ("velocity", f"velocity [{settings.unit_of('mm/s')}]"),
        ("time", "time [s]"),
    ):
        # Samples at rest pile up in one place and would hide what happens there in motion.
        shown = np.ones(len(moving), dtype=bool) if name == "time" else moving
        curves = [
            Curve(kind, *_binned(places[name][shown], values[shown]))
            for kind, values in residuals.items()
            if shown.any()
        ]
        panels.append(Panel(f"Over {name}", Chart(curves, x_label, label, zero=True)))
    curves = [Curve(kind, *_spectrum(values, period)) for kind, values in residuals.items()]
    density = f"density [{unit}/√Hz]"
    panels.append(Panel("Spectrum", Chart(curves, "frequency [Hz]", density, log="xy")))
    return panels


def curve_panel(found: Unlisted, axis: AxisSettings) -> Panel:
    """A force over a coordinate, with one standard deviation on either side."""
    at, force, sigma = (
        np.array(part) for part in (found.curve.at, found.curve.force, found.curve.sigma)
    )
    what, unit, scale = "force", "N", 1.0
    if found.times == "reading":
        what, unit, scale = "encoder error", "µm", 1e6
    force, sigma = scale * force, scale * sigma
    curves = [Curve("measured", at, force, force - sigma, force + sigma)]
    over = found.over.replace("_", " ") + (" since it turned" if found.times == "history" else "")
    label = f"{over} [{axis.unit_of(OVER[found.over])}]"
    title = f"Axis {found.axis}: {what} over {over}"
    return Panel(title, Chart(curves, label, f"{what} [{axis.unit_of(unit)}]"))


def _by_phase(phase: F64, residuals: dict[str, F64], unit: str) -> Table:
    rows = []
    for number, name in enumerate(PHASES):
        at = phase == number
        if at.any():
            sizes = [float(np.sqrt(np.mean(values[at] ** 2))) for values in residuals.values()]
            rows.append((name, *map(digits, sizes)))
    return Table(("Phase of motion", *(f"{kind}, {unit}" for kind in residuals)), rows)


def _binned(place: F64, values: F64) -> tuple[F64, F64]:
    """Rms in bins over a range, without bins that hold too few samples."""
    edges = np.linspace(float(place.min()), float(place.max()) + 1e-12, _BINS + 1)
    at = np.clip(np.searchsorted(edges, place, side="right") - 1, 0, _BINS - 1)
    number = np.bincount(at, minlength=_BINS)
    energy = np.bincount(at, weights=values**2, minlength=_BINS)
    good = number >= _MIN_SAMPLES
    centres = (edges[1:] + edges[:-1]) / 2
    return centres[good], np.sqrt(energy[good] / number[good])


def _spectrum(values: F64, period: float) -> tuple[F64, F64]:
    """Amplitude spectral density by Welch's method."""
    from scipy.signal import welch

    frequency, power = welch(values, 1.0 / period, nperseg=min(_SEGMENT, len(values)))
    return frequency[1:], np.sqrt(power[1:])
