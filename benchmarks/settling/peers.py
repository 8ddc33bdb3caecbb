"""Settling beside what else a control engineer would try, on the same stages.

    python -m benchmarks.settling.peers [--seeds 2] [--peer NAME ...]

Whole runs on the virtual stage, through `stagectl.run.execute`: macro-moves of 25 mm, then steps of
0.1 to 100 um with and against the direction of the one before, both axes. Coulomb force, viscous
friction, stiffness and attraction of the stage are off the machine file's by -40 to +60 %, drawn
for each seed and axis. What learns starts from the file's figures; the first third does not count.
All have mass times acceleration in their offsets. The peers, each as good as we could make it:

- `drive alone`;
- `integrator x 3`: the drive's ki three times as high;
- `disturbance observer`: ours with a rigid mass for a model: no presliding stiffness, and its gain
  as high as the same margins allow for that;
- `basis functions`: viscous friction and three hystereses of Dahl's (over 0.3, 1 and 3 Fc/sigma0),
  learned from every move by recursive least squares with forgetting; integrator x 3;
- `friction table`: force over velocity, eight knots, learned in the same way; integrator x 3.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple, cast
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray

from benchmarks.shared.inspection_runs import measured
from benchmarks.shared.machine_facts import machine_facts
from benchmarks.shared.other_stages import drawn, with_gains
from estimation.move import MoveData
from estimation.trajectory import Trajectory
from stagectl.config.machine import Machine
from stagectl.config.machine.file import load_machine
from stagectl.config.settings.observer import design_observers
from stagectl.recipe import Recipe, parse_recipe
from stagectl.run import HostSettings, Listener, RunRequest, SimulatedStage, execute
from stagectl.sequencer import AxisCompensation, Mode, make_compensation, summarise_moves
from stagedata import FrictionFigures

STEPS = (1e-7, 1e-6, 1e-5, 1e-4)
"""Sizes of steps [m]."""
WINDOWS = (1e-8, 2e-8, 5e-8, 2e-7)
DIRECTIONS = (1, 1, -1, 1, -1, -1)
ROUNDS, LEARNING = 3, 1
"""Rounds of all moves, and how many of them do not count."""
MACRO = 0.025
FORGETTING = 0.98
"""Of what earlier moves have shown, per move."""
DOUBT = 0.5
"""Of the figures at the start, 1 sigma, relative."""
REACHES = np.array([0.3, 1.0, 3.0])
"""Of the hystereses, over Fc/sigma0."""
KNOTS = np.geomspace(1e-4, 0.5, 8)
"""Of the friction table [m/s]."""
RIGID = 1e-6
"""Share of the presliding stiffness that a rigid mass has."""

F64 = NDArray[np.float64]


class Peer(NamedTuple):
    """How a run differs from ours."""

    mode: Mode = Mode.NONE
    observer: bool = False
    integrator: float = 1.0
    compensation: type[LearnedCompensation] | None = None


class LearnedCompensation(AxisCompensation):
    """Force offsets linear in what is learned, from every move."""

    def start(self, friction: FrictionFigures) -> None:
        """Begin with the machine file's figures."""
        self._own, self._hysteresis = friction, np.zeros(len(REACHES))
        self._weights = self.first()
        self._known = np.diag((DOUBT * np.abs(self._weights) + 1e-3) ** -2.0)

    def first(self) -> F64:
        """Figures at the start."""
        raise NotImplementedError

    def basis(self, velocity: F64, way: F64) -> F64:
        """What the friction figures are factors of, (K, M); `way` in each period [m]."""
        raise NotImplementedError

    def force_offsets(
        self,
        trajectory: Trajectory,
        samples: int,
        moment: float,
        position: float,
        rest_force: float,
        rest_offset: float,
        variation: F64 | None = None,
        across: Trajectory | None = None,
    ) -> F64:
        """As in `AxisCompensation`."""
        time = np.arange(samples + 1, dtype=np.float64) * self._period
        time += self.acceleration.ahead
        place, velocity, _ = trajectory.sample(time)
        before = self._hysteresis
        rows = self.basis(velocity, np.diff(place, prepend=place[0]))
        self._hysteresis = before
        friction = rows @ self._weights
        force = self.acceleration.along(trajectory, across, samples)
        found: F64 = rest_offset + force + friction[1:] - friction[0]
        return found

    def learn(self, move: MoveData) -> None:
        """Recursive least squares on what was measured."""
        way = np.gradient(move.position)
        velocity = way / self._period
        rows = self.basis(velocity, way)
        rows = np.column_stack([rows, np.ones(len(rows))])
        wanted = move.force - self.acceleration.mass * np.gradient(velocity) / self._period
        use = move.valid.copy()
        use[:2] = use[-2:] = False
        rows, wanted = rows[use], wanted[use]
        known = np.zeros((rows.shape[1],) * 2)
        known[:-1, :-1] = FORGETTING * self._known
        informed = known + rows.T @ rows  # a residual of 1 N has weight 1
        right = known @ np.append(self._weights, 0.0) + rows.T @ wanted
        self._weights = np.linalg.lstsq(informed, right, rcond=None)[0][:-1]
        last = informed[-1, -1]
        self._known = informed[:-1, :-1] - np.outer(informed[:-1, -1], informed[-1, :-1]) / last


class BasisFunctions(LearnedCompensation):
    """Viscous friction, and Coulomb friction as the sum of Dahl's hystereses."""

    def first(self) -> F64:
        """Figures at the start."""
        shares = np.full(len(REACHES), self._own.coulomb / len(REACHES))
        return np.concatenate([[self._own.viscous], shares])

    def basis(self, velocity: F64, way: F64) -> F64:
        """Velocity, and hystereses carried along."""
        reach = REACHES * self._own.coulomb / self._own.stiffness
        found = np.zeros((len(way), len(REACHES)))
        for k, step in enumerate(way.tolist()):
            kept = np.exp(-abs(step) / reach)
            self._hysteresis = kept * self._hysteresis + (1.0 - kept) * np.sign(step)
            found[k] = self._hysteresis
        return np.column_stack([velocity, found])


class FrictionTable(LearnedCompensation):
    """Friction over velocity, straight between the knots; none at rest."""

    def first(self) -> F64:
        """Figures at the start."""
        found: F64 = self._own.coulomb + self._own.viscous * KNOTS
        return found

    def basis(self, velocity: F64, way: F64) -> F64:
        """Share of each knot."""
        speed = np.log(np.clip(np.abs(velocity), KNOTS[0], KNOTS[-1]))
        shares = [np.interp(speed, np.log(KNOTS), unit) for unit in np.eye(len(KNOTS))]
        moving = np.clip(np.abs(velocity) / KNOTS[0], 0.0, 1.0) * np.sign(velocity)
        return np.column_stack(shares) * moving[:, None]


OURS, DISTURBANCE = "ours", "disturbance observer"
PEERS = {
    "drive alone": Peer(),
    "integrator x 3": Peer(integrator=3.0),
    DISTURBANCE: Peer(observer=True),
    "basis functions": Peer(integrator=3.0, compensation=BasisFunctions),
    "friction table": Peer(integrator=3.0, compensation=FrictionTable),
    OURS: Peer(Mode.ESTIMATED, observer=True),
}


def steps_and_macros(machine: Machine) -> Recipe:
    """All moves, settling after each."""
    lines, place = [], 0.0
    for number in range(ROUNDS):
        for size in STEPS:
            place = MACRO if place < 0.5 * MACRO else 0.0
            lines.append(f"  - {{to: [{place}, {place}], kind: macro}}")
            for direction in DIRECTIONS:
                place += direction * size * (-1) ** number
                lines.append(f"  - {{to: [{place:.9f}, {place:.9f}], kind: micro}}")
    text = (
        "recipe: steps\nmacro: {velocity: 0.5, acceleration: 3.0, jerk: 200.0}\n"
        "micro: {velocity: 0.01, acceleration: 0.2, jerk: 20.0}\n"
        "settle: {window: 1.0e-8, hold: 0.05, timeout: 0.25}\nmoves:\n"
    )
    return parse_recipe(text + "\n".join(lines) + "\n", "steps.yaml", machine)


@contextmanager
def in_place_of_ours(name: str, peer: Peer) -> Iterator[None]:
    """The run uses this peer's force offsets and observer."""
    with ExitStack() as stack:
        own = peer.compensation
        if own is not None:

            def learned(machine: Machine, *args: Any, **more: Any) -> object:
                made = make_compensation(machine, *args, **more)
                for axis, one in zip(machine.axes.values(), made, strict=True):
                    one.__class__ = own
                    cast(LearnedCompensation, one).start(axis.plant.friction.figures)
                return made

            stack.enter_context(patch("stagectl.run.execution.make_compensation", learned))
        if name == DISTURBANCE:

            def rigid(machine: Machine, friction: dict[str, FrictionFigures]) -> object:
                figures = {
                    axis: replace(own, stiffness=RIGID * own.stiffness)
                    for axis, own in friction.items()
                }
                return design_observers(machine, figures)

            stack.enter_context(patch("stagectl.run.observers.design_observers", rigid))
        yield


def settling_of(name: str, peer: Peer, seeds: int) -> dict[tuple[str, float], list[float]]:
    """Settling [ms] by (size of the step, window)."""
    found: dict[tuple[str, float], list[float]] = {}
    machine = load_machine(None)
    for seed in range(1, seeds + 1):
        host, truth = (
            with_gains(stage, {"ki": peer.integrator}) for stage in (machine, drawn(machine, seed))
        )
        with tempfile.TemporaryDirectory() as folder, in_place_of_ours(name, peer):
            request = RunRequest(
                steps_and_macros(host),
                host,
                Path(folder),
                datetime.now(UTC),
                simulated=SimulatedStage(truth, seed),
                host=HostSettings(
                    mode=peer.mode,
                    observer=peer.observer,
                    measurement=measured(host, truth) if peer.observer else None,
                ),
            )
            result = execute(request, Listener())
        if result.error is not None:
            raise result.error
        assert result.recording is not None
        axis = next(iter(machine.axes.values()))
        moves = summarise_moves(
            result.recording, axis.drive.control_period, machine.bus.sync_period, WINDOWS
        )
        first = len(result.recording.moves) * LEARNING // ROUNDS
        for move in moves:
            if move.move < first:
                continue
            size = "macro" if move.kind == "macro" else f"{_step(move.distance) * 1e6:g} µm"
            for window in WINDOWS:
                found.setdefault((size, window), []).append(move.settling[window] * 1e3)
    return found


def _step(distance: float) -> float:
    return min(STEPS, key=lambda size: abs(np.log(size / abs(distance))))


def main() -> None:
    """Run and print one table per window."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seeds", type=int, default=2, help="stages [2]")
    parser.add_argument("--peer", action="append", choices=tuple(PEERS), help="(repeatable)")
    arguments = parser.parse_args()
    found = {
        name: settling_of(name, peer, arguments.seeds)
        for name, peer in PEERS.items()
        if not arguments.peer or name in arguments.peer
    }
    sizes = list(dict.fromkeys(size for size, _ in next(iter(found.values()))))
    print(f"seeds 1..{arguments.seeds}; {machine_facts()}; mean (90th percentile), ms")
    for window in WINDOWS:
        print(f"\n| ±{window * 1e9:.0f} nm | " + " | ".join(sizes) + " |")
        print("| --- |" + " --- |" * len(sizes))
        for name, times in found.items():
            cells = []
            for size in sizes:
                own = times[size, window]
                cells.append(f"{np.mean(own):.1f} ({np.quantile(own, 0.9):.0f})")
            print(f"| {name} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
