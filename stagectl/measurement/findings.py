"""What a measured response contradicts in the machine file, in the file's terms."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from estimation.response import AxisResponse, Figures, Fitted
from stagectl.config.machine import Axis
from stagectl.config.settings.observer import believed_figures, fit_response, offset_step
from stagedata import FrictionFigures

SIGMAS = 3.0
"""A deviation of fewer sigma is none,"""
TOO_COARSE = 0.1
"""Steps of force offsets above this share of the Coulomb force spoil all other figures."""
LEAST = 0.05
"""nor is one of less than this, relative,"""
LEAST_TIME = 1e-4
"""or than this [s],"""
MISFIT = 3.0
"""Above this misfit the figures say nothing."""
LEAST_FREQUENCY = 0.02
"""or, of a resonance's frequency, than this, relative."""


@dataclass(frozen=True, slots=True)
class AxisFindings:
    """What the response of an axis shows.

    Attributes:
        fitted: its figures.
        believed: those of the machine file.
        step: in which force offsets act [N]; None where it is no coarser than they are sent.
        contradictions: one clause each.
    """

    fitted: Fitted
    believed: Figures
    step: float | None
    contradictions: tuple[str, ...]


def find_contradictions(
    axis: Axis, friction: FrictionFigures, period: float, response: AxisResponse
) -> AxisFindings:
    """Compare the response of an axis with its machine file.

    Args:
        axis: of the machine file.
        friction: as the host believes it to be.
        period: Ts [s].
        response: measured.
    """
    fitted = fit_response(axis, friction, period, response)
    believed = believed_figures(axis, friction)
    step = offset_step(axis, response)
    clauses = [*_offsets(fitted, step, axis)]
    if response.sticks and believed.stiffness > 0.0:
        clauses.append("friction does not give way at rest: it has no presliding")
    if fitted.misfit < MISFIT and (step is None or step < TOO_COARSE * friction.coulomb):
        clauses += [*_force(fitted, believed), *_law(fitted, believed)]
        clauses += [*_times(fitted, believed, period), *_resonances(fitted, believed)]
    elif step is None:
        clauses.append("it does not answer like a mass in the loop of the file; no figure is given")
    return AxisFindings(fitted, believed, step, tuple(clauses))


def _offsets(fitted: Fitted, step: float | None, axis: Axis) -> Iterator[str]:
    unit = "N m" if axis.rotary else "N"
    if fitted.figures.sign < 0.0:
        yield "force offsets (0x60B2) act with the wrong sign"
    if step is not None:
        yield f"force offsets act in steps of about {step:.2g} {unit}"


def _force(fitted: Fitted, believed: Figures) -> Iterator[str]:
    ratio = fitted.figures.mass / believed.mass
    if _differs(ratio, fitted.sigma["mass"]):
        yield (
            f"the force per acceleration is {ratio:.3g} times the file's: mass or force constant; "
            "`stagectl gap excite` and `stagectl gap diagnose` tell which"
        )


def _law(fitted: Fitted, believed: Figures) -> Iterator[str]:
    smoothed = believed.derivative_time
    if smoothed > 0.0 and _differs(
        fitted.figures.derivative_time / smoothed, fitted.sigma["derivative_time"]
    ):
        yield f"derivative_time is {fitted.figures.derivative_time / smoothed:.3g} of the file's"
    ratios = {
        name: getattr(fitted.figures, name) / getattr(believed, name)
        for name in ("kp", "ki", "kd")
        if getattr(believed, name)
    }
    mean = math.prod(ratios.values()) ** (1.0 / len(ratios))
    if all(abs(r / mean - 1.0) < max(LEAST, SIGMAS * fitted.sigma[n]) for n, r in ratios.items()):
        if _differs(mean, fitted.sigma["kp"]):
            yield f"kp, ki and kd are {mean:.3g} of the file's"
        return
    for name, ratio in ratios.items():
        if _differs(ratio, fitted.sigma[name]):
            yield f"{name} is {ratio:.3g} of the file's"


def _times(fitted: Fitted, believed: Figures, period: float) -> Iterator[str]:
    own, sigma = fitted.figures, fitted.sigma
    dead = own.dead_time - believed.dead_time
    if abs(dead) > max(LEAST_TIME, SIGMAS * sigma["dead_time"]):
        yield f"the drive's loop has {own.dead_time * 1e3:.2f} ms of dead time, the file " + (
            f"{believed.dead_time * 1e3:.2f} ms" if believed.dead_time else "none"
        )
    if abs(own.lateness) > max(LEAST_TIME, SIGMAS * sigma["lateness"]):
        late = own.lateness
        what = f"{abs(late) * 1e3:.2f} ms ({abs(late) / period:.2g} SYNC periods)"
        yield f"force offsets act {what} {'late' if late > 0.0 else 'early'}"
    age = own.age + own.smoothing
    if age > max(LEAST_TIME, SIGMAS * sigma["position_delay"]):
        how = "filtered and " if own.smoothing > max(LEAST_TIME, abs(own.age)) else ""
        yield f"positions (0x6064) are {how}{age * 1e3:.2f} ms old when they are sampled"


def _resonances(fitted: Fitted, believed: Figures) -> Iterator[str]:
    known = [mode.frequency for mode in believed.resonances]
    for mode in fitted.figures.resonances:
        near = min(known, key=lambda f: abs(f - mode.frequency), default=None)
        if near is not None and abs(mode.frequency / near - 1.0) < 0.2:
            known.remove(near)
            if abs(mode.frequency / near - 1.0) > LEAST_FREQUENCY:
                yield f"the resonance is at {mode.frequency:.0f} Hz, not at {near:.0f} Hz"
        else:
            yield f"a resonance at {mode.frequency:.0f} Hz that the file does not have"
    for frequency in known:
        yield f"no resonance shows at {frequency:.0f} Hz, where the file has one"


def _differs(ratio: float, sigma: float) -> bool:
    return abs(ratio - 1.0) > max(LEAST, SIGMAS * sigma)
