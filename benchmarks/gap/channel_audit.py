"""Channel audit: effects must raise no finding, corrupted channels must raise the right one.

    python -m benchmarks.gap.channel_audit [--trials 3] [--seed 1]

Stages with each effect of the library, at random places of its range, are simulated over the
demands of a packaged recording; then the same stages with one channel corrupted. Prints false,
missed and wrong findings and the errors of the figures found; exit code 1 if any finding is wrong.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

from hil_sim.effects.library import library, possible_on
from hil_sim.plant import simulate
from sim2real.audit import audit_channels
from sim2real.audit.channels import Audit
from stagectl.config import load_machine, stage_settings
from stagectl.store import read_recording
from stagedata import Recording

DEMANDS = Path(__file__).parents[2] / "tests" / "data" / "null-1.h5"
SAMPLES = 5000
REPORTED_ONLY = {"saturation"}
"""Findings that are true of stages with strong effects."""

Array = np.ndarray
Spoil = Callable[[Array], Array]


def main() -> None:
    """Run both parts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=3, help="stages per effect [3]")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    stage = stage_settings(load_machine())
    base = read_recording(DEMANDS)
    sound, false, paths = 0, [], []
    stages: list[tuple[Recording, str]] = []
    for name, effect in possible_on(stage.axes[0], library()).items():
        for _ in range(arguments.trials):
            a = int(rng.integers(len(stage.axes)))
            axis = stage.axes[a]
            values = {}
            for parameter in effect.parameters:
                ranges = parameter.ranges(axis)
                values[parameter.key] = float(rng.uniform(*ranges[rng.integers(len(ranges))]))
            axes = list(stage.axes)
            axes[a] = replace(axis, effects=(effect.at(**values),))
            made = recorded(base, replace(stage, axes=tuple(axes)), int(rng.integers(2**31)))
            found = audit_channels(made, stage)
            wrong = [f.text for f in found.findings if f.finding not in REPORTED_ONLY]
            sound += not wrong
            false += [(name, values, wrong)] if wrong else []
            if path := found.current_paths.get(axis.name):
                if name == "dead_time" and path.dead_time is not None:
                    paths.append(("dead time [us]", 1e6 * (path.dead_time - values["delay"])))
                if name == "current_bandwidth" and path.bandwidth is not None:
                    relative = path.bandwidth / values["bandwidth"] - 1.0
                    paths.append(("bandwidth [%]", 100.0 * relative))
            if name not in ("dead_time", "current_bandwidth", "force_saturation"):
                stages.append((made, axis.name))
    total = sound + len(false)
    print(f"stages with one effect: {total}, without a finding {sound}")
    for entry in false:
        print("  FALSE", *entry)
    for kind in ("dead time [us]", "bandwidth [%]"):
        errors = [e for k, e in paths if k == kind]
        if errors:
            print(f"  {kind}: largest error {max(map(abs, errors)):.2g} in {len(errors)}")
    bad = len(false) + corruptions(stages, stage, rng)
    sys.exit(1 if bad else 0)


def corruptions(stages: list[tuple[Recording, str]], stage: object, rng: object) -> int:
    """Corrupt one channel of one axis of each stage; prints a table, returns how many are wrong."""
    right: Counter[str] = Counter()
    count: Counter[str] = Counter()
    worst: dict[str, float] = {}
    for number, (made, _) in enumerate(stages):
        for offset in range(3):
            kinds = list(_KINDS.items())
            kind, draw = kinds[(3 * number + offset) % len(kinds)]
            axis = ("x", "y")[int(rng.integers(2))]  # type: ignore[attr-defined]
            channel, finding, value, spoil = draw(rng)
            signals = made.axes[axis]
            changed = {name: spoil(getattr(signals, name)) for name in channel}
            bad = replace(made, axes={**made.axes, axis: replace(signals, **changed)})
            found: Audit = audit_channels(bad, stage)  # type: ignore[arg-type]
            found_kinds = {
                (f.axis, f.channel, f.finding): f.value
                for f in found.findings
                if f.finding not in REPORTED_ONLY
            }
            count[kind] += 1
            expected = (axis, channel[0], finding)
            if set(found_kinds) == {expected}:
                right[kind] += 1
                error = abs((found_kinds[expected] or 0.0) / value - 1.0)
                worst[kind] = max(worst.get(kind, 0.0), error)
            else:
                print("  WRONG", kind, axis, f"{value:.4g}", [f.text for f in found.findings])
    print("corruption | right | of | largest error of the figure")
    for kind in count:
        print(f"{kind} | {right[kind]} | {count[kind]} | {100 * worst.get(kind, 0.0):.2g} %")
    return sum(count.values()) - sum(right.values())


def recorded(base: Recording, settings: object, seed: int) -> Recording:
    """A stage recorded over the first demands of a recording."""
    demand = np.column_stack([a.position_demand[:SAMPLES] for a in base.axes.values()])
    offset = np.column_stack([a.force_offset[:SAMPLES] for a in base.axes.values()])
    response = simulate(settings, demand, offset, seed)  # type: ignore[arg-type]
    axes = {
        name: replace(
            signals,
            position_demand=demand[:, i],
            force_offset=offset[:, i],
            position_actual=response.position[:, i],
            force_actual=response.force[:, i],
            statusword=None,
            valid=np.ones(SAMPLES, dtype=bool),
        )
        for i, (name, signals) in enumerate(base.axes.items())
    }
    moves = tuple(m for m in base.moves if m.end <= SAMPLES)
    return replace(base, time=base.time[:SAMPLES], axes=axes, moves=moves)


def _later(samples: int) -> Spoil:
    return lambda v: np.concatenate((np.repeat(v[:1], samples), v[:-samples]))


def _interpolated(delay: float) -> Spoil:
    def spoil(values: Array) -> Array:
        time = np.arange(len(values)) * 1e-3
        return CubicSpline(time, values)(np.clip(time - delay, 0.0, None))

    return spoil


def _whole(channel: str):
    def draw(rng):
        samples = int(rng.integers(1, 4))
        return (channel,), "delay", samples * 1e-3, _later(samples)

    return draw


def _fraction(channel: str):
    def draw(rng):
        delay = float(rng.uniform(0.2e-3, 0.9e-3))
        return (channel,), "delay", delay, _interpolated(delay)

    return draw


def _scaled(channel: str, finding: str, low: float, high: float):
    def draw(rng):
        factor = float(rng.choice([rng.uniform(low, 0.99), rng.uniform(1.01, high)]))
        return (channel,), finding, factor, lambda v: factor * v

    return draw


def _times(channel: str, finding: str, factor: float):
    return lambda _rng: ((channel,), finding, factor, lambda v: factor * v)


def _coarse(channel: str, low: float, high: float):
    def draw(rng):
        step = float(rng.integers(low, high)) * (1e-9 if channel == "position_actual" else 0.04)
        return (channel,), "quantisation", step, lambda v: np.rint(v / step) * step

    return draw


_KINDS = {
    "position late, whole samples": _whole("position_actual"),
    "position late, a fraction": _fraction("position_actual"),
    "position in mm": _times("position_actual", "units", 1e3),
    "position with the wrong sign": _times("position_actual", "sign", -1.0),
    "position scaled": _scaled("position_actual", "scale", 0.95, 1.05),
    "position coarse": _coarse("position_actual", 5, 60),
    "force late, whole samples": _whole("force_actual"),
    "force late, a fraction": _fraction("force_actual"),
    "force in mN": _times("force_actual", "units", 1e3),
    "force with the wrong sign": _times("force_actual", "sign", -1.0),
    "force scaled": _scaled("force_actual", "scale", 0.8, 1.25),
    "force coarse": _coarse("force_actual", 4, 25),
    "force offset scaled": _scaled("force_offset", "scale", 0.5, 1.5),
    "force offset with the wrong sign": _times("force_offset", "sign", -1.0),
    "demand in mm": _times("position_demand", "units", 1e3),
}


if __name__ == "__main__":
    main()
