"""The drive's controller recomputed from the log: the force it must have commanded.

The law is that of docs/reference/reference-stage.md ("The drive, each control tick"): between two
SYNCs the demand is known exactly, the encoder is interpolated by a cubic spline through the logged
positions, and the commanded force passes through the current loop to the instant of sampling. The
mechanics play no part: whatever acts on the stage, a drive that computes this law reports this
force. On recordings of a stage that does, the remainder is the rounding of 0x6077. Dead time and
current bandwidth lie between command and report, so they are seen here separately from everything
else.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from hil_sim.plant import build_ports
from hil_sim.settings import ControlSettings, StageSettings
from sim2real.filters import filtered
from sim2real.gap import Replay
from stagedata import BoolArray, FloatArray

TERMS = ("kp", "ki", "kd", "force_offset")
"""Parts of the commanded force, in the order of `ControllerLaw.terms`."""
_NEAR_PEAK = 0.9
"""Share of the peak force from which the output may have been clamped next to a sample."""
WARM_UP = 20
"""Samples within which the derivative filter forgets that the law was started in mid-motion."""
_MARGIN = 4
"""Samples at both ends and next to gaps where the interpolation is not accurate enough."""


@dataclass(frozen=True, slots=True)
class Timing:
    """Time shifts of the logged channels against the law [s]; all zero as the machine file says.

    Attributes:
        lag: from the law's output to the current loop, beyond the machine file's dead time;
            negative: the force is logged early.
        position: by how much the logged position is late.
        demand: by how much the setpoints act late.
        drift: growth of the logged position's lateness per second [s/s].
        resampled: by how much the logged force was moved later by interpolation between its
            samples. (Force sampled late within the drive is `lag`: between SYNCs the force is
            not a straight line, because the demand's velocity steps at each.)
    """

    lag: float = 0.0
    position: float = 0.0
    demand: float = 0.0
    drift: float = 0.0
    resampled: float = 0.0


AS_STATED = Timing()
"""The timing of the machine file."""


@dataclass(frozen=True, slots=True, eq=False)
class ControllerLaw:
    """One axis' controller and the log it is compared with: P SYNC periods, K samples.

    Attributes:
        control: of the machine file.
        period: SYNC period [s].
        demand, offset: setpoints of every SYNC period, float64[P] [m, N].
        place: int64[K], number of the SYNC period that each sample belongs to.
        force: logged, float64[K] [N].
        usable: bool[K], samples at which the law can be recomputed.
        encoder: spline through the logged positions over time [s].
        dead_time, bandwidth: between controller and force by the machine file, effects included
            [s, Hz].
        begin: number of the first SYNC period.
        halted: bool[ticks], where the output was clamped and the integrator halted; None where it
            never was.
    """

    control: ControlSettings
    period: float
    demand: FloatArray
    offset: FloatArray
    place: NDArray[np.int64]
    force: FloatArray
    usable: BoolArray
    encoder: CubicSpline
    dead_time: float
    bandwidth: float
    begin: int = 0
    halted: BoolArray | None = None

    def terms(self, timing: Timing = AS_STATED, bandwidth: float | None = None) -> FloatArray:
        """Parts of the reported force, float64[4, K] [N], in the order of `TERMS`.

        They are known up to a constant, as the integrator may have started at any value.

        Args:
            timing: of the channels.
            bandwidth: of the current loop [Hz]; None for the machine file's.
        """
        tick = self.control.period
        ticks = round(self.period / tick)
        parts = self._parts(timing)
        count = parts.shape[1]
        # The current loop, exact for a held input that changes `part` after the tick.
        shift, part = divmod((timing.lag + self.dead_time) / tick, 1.0)
        corner = 2.0 * math.pi * (self.bandwidth if bandwidth is None else bandwidth)
        new = -math.expm1(-corner * tick * (1.0 - part))
        whole = -math.expm1(-corner * tick)
        out = filtered([new, whole - new], [1.0, whole - 1.0], parts)
        # Sample k is taken before the tick of SYNC k.
        sampled = (self.place - self.begin) * ticks - 1 - int(shift)
        reported: FloatArray = np.where(sampled >= 0, out[:, np.clip(sampled, 0, count - 1)], 0.0)
        if timing.resampled:
            times = self.place * self.period
            late = times - timing.resampled
            reported = np.array([np.interp(late, times, part) for part in reported])
        return reported

    def _parts(self, timing: Timing) -> FloatArray:
        """Parts of the law's output at each tick, float64[4, ticks] [N]."""
        tick = self.control.period
        ticks = round(self.period / tick)
        count = len(self.demand) * ticks
        at = (np.arange(count) + self.begin * ticks) * tick
        # The ramp to setpoint k ends with the last tick before SYNC k + 1.
        reached = (np.arange(len(self.demand)) + self.begin + 1) * self.period - tick
        demand = np.interp(at - timing.demand, reached, self.demand)
        offset = np.interp(at - timing.demand, reached, self.offset)
        error = demand - self.encoder(at + timing.position + timing.drift * at)
        damping, integrand = self._damping(demand, error)
        if self.halted is not None:
            integrand = np.where(self.halted, 0.0, integrand)
        integral = np.concatenate(([0.0], np.cumsum(integrand)[:-1])) * tick
        parts: FloatArray = np.stack((self.control.kp * error, integral, damping, offset))
        return parts

    def with_positions_divided(self, factor: float) -> ControllerLaw:
        """The law of a log whose positions were scaled by a factor."""
        spline = self.encoder
        return replace(self, encoder=CubicSpline.construct_fast(spline.c / factor, spline.x))

    def position_error_columns(self) -> FloatArray:
        """Force per error of the logged position, float64[2, K]: by its offset [N/m], scale [N]."""
        time = self.place * self.period
        control = self.control
        offset = control.kp + control.ki * (time - time[0])
        followed = self.demand[self.place - self.begin]
        scale = control.kp * followed + control.ki * self.period * np.cumsum(followed)
        slip: FloatArray = -np.stack((offset, scale))
        return slip

    def most_travelled(self, samples: int) -> ControllerLaw:
        """The law over the span of this many samples in which the demand travels farthest."""
        count = len(self.place)
        if samples >= count:
            return self
        gone = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(self.demand)))))
        travelled = gone[self.place[samples - 1 :]] - gone[self.place[: count - samples + 1]]
        start = int(np.argmax(travelled))
        first, last = int(self.place[start]), int(self.place[start + samples - 1])
        ticks = round(self.period / self.control.period)
        usable = self.usable[start : start + samples].copy()
        usable[:WARM_UP] = False
        return replace(
            self,
            demand=self.demand[first : last + 1],
            offset=self.offset[first : last + 1],
            place=self.place[start : start + samples],
            force=self.force[start : start + samples],
            usable=usable,
            begin=self.begin + first,
            halted=None if self.halted is None else self.halted[first * ticks : (last + 1) * ticks],
        )

    def _damping(self, demand: FloatArray, error: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Derivative force at each tick [N], and the integrator's input there [N/s].

        Args:
            demand: float64[ticks] [m].
            error: demand less encoder, float64[ticks] [m].
        """
        control, tick = self.control, self.control.period
        keep = tick / (control.derivative_time + tick)
        cascade = control.cascade
        if cascade is None:
            rate = np.diff(error, prepend=error[:1]) / tick
            smooth = filtered([keep], [1.0, keep - 1.0], rate)
            return control.kd * smooth, control.ki * error
        reading = demand - error
        before = np.concatenate((np.repeat(reading[:1], cascade.span), reading[: -cascade.span]))
        rate = (reading - before) / (cascade.span * tick)
        missing = -filtered([keep], [1.0, keep - 1.0], rate)
        missing += cascade.feedforward * np.diff(demand, prepend=demand[:1]) / tick
        wanted = cascade.position_gain * error + missing
        return cascade.velocity_gain * missing, cascade.velocity_integral * wanted

    def with_clamping(self) -> ControllerLaw:
        """The law with the ticks at which a clamped output halts the integrator.

        It is sought only where the logged force is near its peak, since against a late log, or one
        in other units, the law would seem to exceed the peak all the time. Samples next to these
        ticks are no longer usable.
        """
        peak = self.control.peak_force
        ticks = round(self.period / self.control.period)
        full = np.zeros(len(self.demand), dtype=bool)
        full[self.place[np.abs(self.force) >= _NEAR_PEAK * peak]] = True
        full = np.convolve(full, np.ones(2 * _MARGIN + 1), mode="same") > 0.5
        if not full.any():
            return self
        parts = self._parts(AS_STATED)
        rest = (parts[0] + parts[2] + parts[3]).tolist()
        growing = np.diff(parts[1], append=parts[1][-1:]).tolist()
        near = np.repeat(full, ticks).tolist()
        halted = np.zeros(len(rest), dtype=bool)
        integral = 0.0
        for j, (other, more) in enumerate(zip(rest, growing, strict=True)):
            raw = integral + other
            if near[j] and abs(raw) > peak and (raw > 0.0) == (more > 0.0):
                halted[j] = True
            else:
                integral += more
        return replace(self, halted=halted, usable=self.usable & ~full[self.place])


def reconstruct_law(replay: Replay, settings: StageSettings, axis: str) -> ControllerLaw:
    """The controller of one axis and the log it is compared with.

    Raises:
        ValueError: fewer valid samples than an interpolation needs.
    """
    index = replay.names.index(axis)
    signals = replay.recording.axes[axis]
    valid = np.flatnonzero(signals.valid)
    if len(valid) < 4 * _MARGIN:
        raise ValueError(f"axis {axis}: only {len(valid)} valid samples")
    usable = signals.valid.copy()
    usable[: valid[0] + _MARGIN] = False
    usable[valid[-1] + 1 - _MARGIN :] = False
    places = replay.place[valid]
    for gap in np.flatnonzero(np.diff(places) > 1):
        usable[max(valid[gap] + 1 - _MARGIN, 0) : valid[gap + 1] + _MARGIN] = False
    ports = build_ports(settings, 0.0)[index]
    return ControllerLaw(
        settings.axes[index].control,
        replay.period,
        replay.demand[:, index],
        replay.offset[:, index],
        replay.place,
        signals.force_actual,
        usable,
        CubicSpline(places * replay.period, signals.position_actual[valid]),
        ports.delay,
        ports.current_bandwidth,
    ).with_clamping()
