"""Machines of other kinds, by equations of their own: no code of the simulator, no stage of ours.

Each is a motion in closed form and the force that it takes, with friction as a smooth step over
velocity, logged with noise, in its own units, as a text file beside an import map and a machine
file that leaves nearly everything unknown.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
Force = Callable[[F64, F64, F64, F64], F64]
"""Time, position, velocity, acceleration -> force, in SI."""

_MACHINE = """
machine: other
bus: {{interface: virtual, channel: other, bitrate: 1000000, sync_period: {period}}}
axes:
  a:
    node: 1
    rotary: {rotary}
    travel: [{low}, {high}]
    limits: {{velocity: {speed}, acceleration: {acceleration}, jerk: 1000, following_error: 0.01}}
    encoder: {{increment: {increment}, noise: 0}}
    drive:
      rated_force: {rated}
      peak_force: {peak}
      current_bandwidth: 500
      control_period: {tick}
      position_unit: 1e-8
      pid: unknown
    plant:
      tolerance: 0.02
      mass: {mass}
      friction:
        model: gms
        elements: 4
        coulomb: {coulomb}
        static_ratio: 0
        stribeck_velocity: unknown
        stribeck_shape: 1
        stiffness: unknown
        attraction: unknown
        viscous: {viscous}
"""


@dataclass(frozen=True)
class Machine:
    """A machine and how it logs.

    Attributes:
        rate: of the log [Hz].
        noise: of position and force, rms, SI.
        motion: time -> position, SI.
        force: of the motion.
        rated: unit of forces, SI.
        position, torque: entries of the import map, with units; factors from SI are `scales`.
        scales: logged value per SI unit, of position and force.
        text: of separator and decimal point.
        known: mass, coulomb, viscous as in the machine file.
    """

    rate: float
    noise: tuple[float, float]
    motion: Callable[[F64], F64]
    force: Force
    rated: float
    position: str
    torque: str
    scales: tuple[float, float]
    text: tuple[str, str] = (",", ".")
    known: tuple[str, str, str] = ("unknown", "unknown", "unknown")
    duration: float = 20.0
    seed: int = 5

    def write(self, folder):
        """Data and map."""
        fine = 20
        t = np.arange(int(self.duration * self.rate) * fine) / (self.rate * fine)
        x = self.motion(t)
        v = np.gradient(x, t)
        force = self.force(t, x, v, np.gradient(v, t))[fine // 2 :: fine]
        x, v, t = x[fine // 2 :: fine], v[fine // 2 :: fine], t[fine // 2 :: fine]
        rng = np.random.default_rng(self.seed)
        logged = (
            (x + self.noise[0] * rng.standard_normal(len(x))) * self.scales[0],
            (force + self.noise[1] * rng.standard_normal(len(x))) * self.scales[1],
        )
        separator, point = self.text
        lines = [separator.join(("time", "pos", "tau"))]
        for row in zip(t - t[0], *logged, strict=True):
            lines.append(separator.join(f"{value:.10g}".replace(".", point) for value in row))
        data = folder / "log.csv"
        data.write_text("\n".join(lines) + "\n", encoding="utf-8")
        low, high = float(x.min()), float(x.max())
        peak = 1.5 * float(np.abs(force).max())
        mass, coulomb, viscous = self.known
        (folder / "machine.yaml").write_text(
            _MACHINE.format(
                period=1.0 / self.rate,
                rotary="deg" in self.position,
                low=low - 0.02 * (high - low),
                high=high + 0.02 * (high - low),
                speed=1.1 * float(np.abs(v).max()),
                acceleration=1.3 * float(np.abs(np.gradient(v, t)).max()),
                increment=1.0 / self.scales[0] if "counts" in self.position else 1e-7,
                rated=self.rated,
                peak=max(peak, 1.01 * self.rated),
                tick=min(1.0 / self.rate, 1e-3),
                mass=mass,
                coulomb=coulomb,
                viscous=viscous,
            ),
            encoding="utf-8",
        )
        (folder / "map.yaml").write_text(
            "machine: machine.yaml\ntime: {column: time}\naxes:\n  a:\n"
            f"    position_actual: {{column: pos, {self.position}}}\n"
            f"    force_actual: {{column: tau, {self.torque}}}\n",
            encoding="utf-8",
        )
        return data, folder / "map.yaml"


def sliding(v, level, slope):
    """Coulomb and viscous friction [N, N s/m] of a velocity [m/s]."""
    return level * np.tanh(v / (1e-3 * np.abs(v).max())) + slope * v


def swings(amplitudes, frequencies):
    """A motion without any standstill: a sum of sines, as robots are identified by."""

    def motion(t):
        ramp = np.clip(t / 1.0, 0.0, 1.0)
        ramp = ramp**3 * (10.0 - 15.0 * ramp + 6.0 * ramp**2)
        parts = zip(amplitudes, frequencies, strict=True)
        return np.asarray(ramp * sum(a * np.sin(2 * np.pi * f * t + f) for a, f in parts))

    return motion


def strokes(length, speeds, acceleration):
    """Strokes there and back with rests, one pair for each speed, over and over."""

    def motion(t):
        x = np.zeros_like(t)
        begin, at, number = 0.3, 0.0, 0
        while begin < t[-1]:
            speed = speeds[(number // 2) % len(speeds)]
            ramp = speed / acceleration
            total = length / speed + ramp
            s = np.clip(t - begin, 0.0, total)
            gone = np.where(
                s < ramp,
                acceleration * s**2 / 2,
                np.where(
                    s < total - ramp,
                    speed * (s - ramp / 2),
                    length - acceleration * (total - s) ** 2 / 2,
                ),
            )
            sign = 1.0 if at == 0.0 else -1.0
            x += sign * gone
            at += sign * length
            begin += total + 0.25
            number += 1
        return x

    return motion


def _robot(t, q, v, a):
    return 1.2 * a + sliding(v, 4.0, 3.0) + 15.0 * np.sin(q + 0.3)


def _belt(t, x, v, a):
    level = 20.0 * (1.0 + 0.5 * np.exp(-(((x - 0.7) / 0.06) ** 2)))
    return 12.0 * a + sliding(v, level, 18.0)


def _screw(t, x, v, a):
    uneven = np.where(v > 0, 1.15, 0.85)
    return 80.0 * a + sliding(v, 40.0, 200.0 * uneven) + 6.0 * np.sin(2 * np.pi * x / 0.01 + 0.8)


def _tool(t, x, v, a):
    return 300.0 * a + sliding(v, 250.0, 400.0) + 80.0


def _actuator(t, x, v, a):
    return 0.4 * a + sliding(v, 1.5 * (1.0 + 0.5 * np.exp(-t / 6.0)), 4.0)


ROBOT = Machine(
    1000.0, (1e-5, 2.0), swings((0.8, 0.3, 0.1), (0.2, 0.7, 1.9)), _robot, 40.0,
    "unit: deg", "unit: N m", (180.0 / np.pi, 1.0),
)  # fmt: skip
BELT = Machine(
    500.0, (2e-5, 2.0), strokes(1.2, (0.4, 0.8, 1.5), 4.0), _belt, 60.0,
    "unit: mm", "unit: '%'", (1e3, 100.0 / 60.0), (";", ","), duration=24.0,
)  # fmt: skip
SCREW = Machine(
    500.0, (1e-7, 3.0), strokes(0.2, (0.04, 0.08, 0.2), 2.0), _screw, 100.0,
    "unit: counts", "unit: A, factor: 50", (1.0 / 2e-7, 1.0 / 50.0), duration=20.0,
)  # fmt: skip
TOOL = Machine(
    100.0, (1e-6, 15.0), strokes(0.4, (0.05, 0.15, 0.3), 1.0), _tool, 1000.0,
    "unit: mm", "unit: kN", (1e3, 1e-3), ("\t", "."), duration=60.0,
)  # fmt: skip
ACTUATOR = Machine(
    2000.0, (1e-7, 0.1), strokes(0.03, (0.02, 0.06), 2.0), _actuator, 5.0,
    "unit: um", "unit: mN", (1e6, 1e3), duration=20.0,
)  # fmt: skip
