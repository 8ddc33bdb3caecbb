"""Seeded runs of a short recipe with faults of bus and drives, each checked for a safe outcome.

    python -m benchmarks.robustness.fault_campaign [--runs 2000] [--first 1] [--friction-scale 1.0]
        [--retries 0]

Each scenario depends on its number alone: one to three faults (hil_sim/bus/faults.py) at times
between power-on and the end of the run. Required of each run:

- it ends as completed, aborted or fault, within bounds of virtual and of wall time;
- a fault is named: axis or bus, and cause;
- within 50 ms of virtual time after the host begins to stop, no drive that the host can reach is
  in OPERATION ENABLED; a drive out of reach leaves it by its own heartbeat consumer. At the end no
  drive is enabled;
- summary and recording exist and can be read, with lost samples marked;
- no wrong friction figures were accepted: they are within the tolerance below plus three of the
  standard deviations that the estimate states.

Prints a table of the outcomes and every violation with its scenario. Exit code 1 if there are any.
"""

from __future__ import annotations

import argparse
import json
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from types import FrameType

import numpy as np

from hil_sim.bus import World
from hil_sim.bus import faults as f
from hil_sim.cia402 import State
from hil_sim.stage import VirtualStage
from stagectl.config.machine import Machine
from stagectl.config.machine.file import load_machine
from stagectl.recipe import Recipe, parse_recipe
from stagectl.run import HostSettings, Listener, RunRequest, RunResult, SimulatedStage, execute
from stagectl.sequencer import Mode, make_compensation
from stagectl.store import read_recording

RECIPE = """\
recipe: four-sites
macro: {velocity: 0.5, acceleration: 3.0, jerk: 200.0}
micro: {velocity: 0.01, acceleration: 0.2, jerk: 20.0}
settle: {window: 5.0e-8, hold: 0.005, timeout: 0.15}
expose: 0.02
sites: [[0.004, -0.003], [0.02, 0.01], [0.0, 0.02], [-0.015, 0.0]]
fiducial: {source: simulated, range: 80.0e-6, seed: 1}
"""
HOMED = 1.2
"""About when homing is over at the earliest, depending on where the stage stands at first [s]."""
END = 3.6
"""About when the recipe, which takes 1.4 s, is over at the latest [s]."""
REACTION = 0.05
"""After the host begins to stop, drives that it can reach have left OPERATION ENABLED [s]."""
HEARTBEAT = 0.5
"""After which silence of the host a drive stops by itself [s]."""
LONGEST = 400.0
"""Bound of virtual time [s]; a homing that does not end is given 300 s by its axis' travel."""
WALL = 100
"""Bound of wall time [s]."""
OFTEN = 0.3
"""Frames doubled with this probability are not doubled now and then."""
TOLERANCE = {"coulomb": 0.08, "viscous": 0.25, "stiffness": 0.12}
"""Of accepted friction figures, relative to the truth."""

_ENABLE = 0x000F
_DRIVE_FAULTS = tuple(f.DRIVE_FAULTS.values())[:5]  # a longer list would change all scenarios
_FRAMES = (
    ("host", 0x080, "sync"), ("host", 0x201, "rpdo x"), ("host", 0x202, "rpdo y"),
    ("drives", 0x181, "tpdo x"), ("drives", 0x182, "tpdo y"), ("drives", 0x701, "heartbeat x"),
    ("drives", 0x702, "heartbeat y"), ("host", 0x77F, "heartbeat host"),
    ("host", 0x601, "sdo request x"), ("drives", 0x582, "sdo answer y"),
)  # fmt: skip


class Hang(Exception):  # noqa: N818
    """A bound of time was passed."""


@dataclass(frozen=True)
class Scenario:
    """What goes wrong in one run.

    Attributes:
        number: what it was made from.
        kinds: of its faults, for the table.
        plan: the faults.
        stop: when the operator asks for a stop besides [s], None for never.
    """

    number: int
    kinds: tuple[str, ...]
    plan: f.FaultPlan
    stop: float | None = None

    def __str__(self) -> str:
        asked = "" if self.stop is None else f"; asked to stop at {self.stop:.3f} s"
        return f"scenario {self.number}: " + "; ".join(str(x) for x in self.plan.faults) + asked


@dataclass
class Outcome:
    """How one run went.

    Attributes:
        scenario: of the run.
        ending: completed, aborted, fault, or what else happened.
        cause: of a fault.
        violations: of what is asked.
        struck: whether any of the faults happened before the run was over.
    """

    scenario: Scenario
    ending: str = ""
    cause: str = ""
    violations: list[str] = field(default_factory=list)
    struck: bool = False


def make_scenario(number: int) -> Scenario:
    """The scenario of a number."""
    random = np.random.default_rng((0x43414D50, number))
    made = [_fault(random) for _ in range(int(random.choice([1, 1, 1, 2, 3])))]
    faults = tuple(fault for _, fault in made)
    stop = float(random.uniform(HOMED, END)) if random.random() < 0.1 else None
    kinds = (*(kind for kind, _ in made), *(["asked to stop"] if stop is not None else []))
    return Scenario(number, kinds, f.FaultPlan(faults, number), stop)


def _fault(random: np.random.Generator) -> tuple[str, f.Fault]:
    kind = str(
        random.choice(
            ["drop", "duplicate", "delay", "reorder", "resize", "freeze", "sync jitter",
             "sync miss", "bus-off drive", "bus-off host", "reboot", "silence drive",
             "silence host", "sdo abort", "drive fault at", "drive fault in place"]
        )
    )  # fmt: skip
    at = float(random.uniform(HOMED, END) if random.random() < 0.85 else random.uniform(0, HOMED))
    node = int(random.integers(1, 3))
    lasting = float(10 ** random.uniform(-3, 0.3))
    match kind:
        case "sync jitter":
            most = float(10 ** random.uniform(-6, -3.2))
            return kind, f.Delay(f.Frames(frozenset({0x80}), "host"), 0.0, most)
        case "sync miss":
            receiver = node if random.random() < 0.5 else None
            return kind, f.Drop(
                f.Frames(frozenset({0x80}), "host", receiver, at, at + lasting, probability=0.5)
            )
        case "bus-off drive":
            return kind, f.BusOff(node, at, lasting)
        case "bus-off host":
            return kind, f.BusOff(None, at, lasting)
        case "reboot":
            return kind, f.Reboot(node, at)
        case "silence drive":
            return kind, f.Drop(f.Frames(frozenset({0x700 + node}), "drives", None, at))
        case "silence host":
            return kind, f.Drop(f.Frames(frozenset({0x77F}), "host", None, at))
        case "sdo abort":
            times = int(random.choice([1, 1, 3]))
            return kind, f.SdoAbort(node, int(random.integers(1, 120)), times)
        case "drive fault at":
            code = int(random.choice(_DRIVE_FAULTS))
            return kind, f.DriveFault(node, code, at=at)
        case "drive fault in place":
            code = int(random.choice(_DRIVE_FAULTS))
            return kind, f.DriveFault(node, code, position=float(random.uniform(-0.01, 0.015)))
    return kind, _fault_of_frames(kind, at, lasting, random)


def _fault_of_frames(kind: str, at: float, lasting: float, random: np.random.Generator) -> f.Fault:
    sender, can_id, _ = _FRAMES[int(random.integers(len(_FRAMES)))]
    probability = float(random.choice([1.0, 0.3, 0.03, 0.003]))
    until = at + lasting if random.random() < 0.6 else np.inf
    frames = f.Frames(
        frozenset({can_id}), "host" if sender == "host" else "drives", None, at, until,
        probability=probability,
    )  # fmt: skip
    match kind:
        case "drop":
            return f.Drop(frames)
        case "duplicate":
            return f.Duplicate(frames, int(random.integers(1, 4)))
        case "delay":
            return f.Delay(frames, 0.0, float(10 ** random.uniform(-5, -2)))
        case "reorder":
            return f.Reorder(frames, float(10 ** random.uniform(-4, -2.3)))
        case "resize":
            return f.Resize(frames, int(random.integers(0, 9)))
        case _:
            return f.Freeze(frames)


class Watch:
    """Follows power states of the drives, every millisecond of virtual time.

    Attributes:
        enabled_until: node -> when it was last seen in OPERATION ENABLED [s].
    """

    def __init__(self, stop_at: float | None = None) -> None:
        self.enabled_until: dict[int, float] = {}
        self._stop_at = np.inf if stop_at is None else stop_at
        self._stop: Callable[[str], None] | None = None
        self.stage: VirtualStage | None = None
        self.world: World | None = None

    def __call__(self, stage: VirtualStage, world: World) -> None:
        """The stage was switched on."""
        self.stage, self.world = stage, world
        self._look()

    def stoppable(self, stop: Callable[[str], None]) -> None:
        """The run can be stopped from now on."""
        self._stop = stop

    def rest(self, duration: float) -> None:
        """Let virtual time go on after the run [s]."""
        if self.world is not None:
            self.world.sleep_until_ns(self.world.now_ns + round(duration * 1e9))

    def _look(self) -> None:
        assert self.world is not None
        assert self.stage is not None
        now = self.world.now_ns
        if now > LONGEST * 1e9:
            raise Hang(f"more than {LONGEST:g} s of virtual time")
        if now * 1e-9 >= self._stop_at and self._stop is not None:
            self._stop("asked to stop")
        for drive in self.stage.drives:
            if drive.motion.state is State.ENABLED:
                self.enabled_until[drive.node_id] = now * 1e-9
        self.world.at(now + 1_000_000, self._look)


def run(
    scenario: Scenario,
    machine: Machine,
    recipe: Recipe,
    folder: Path,
    scale: float = 1.0,
    retries: int = 0,
) -> Outcome:
    """One run, and what there is to say against it.

    Args:
        scenario: what goes wrong.
        machine: of host and virtual stage.
        recipe: to be run.
        folder: for its files.
        scale: of the friction figures that the host starts from.
        retries: how often it begins a site again after a fault.
    """
    outcome, watch = Outcome(scenario), Watch(scenario.stop)
    request = RunRequest(
        recipe,
        machine,
        folder,
        datetime.now(UTC),
        simulated=SimulatedStage(machine, scenario.number, scenario.plan),
        host=HostSettings(friction_scale=scale),
        retries=retries,
    )
    try:
        with _bound_of_wall_time():
            result = execute(request, Listener(stoppable=watch.stoppable, switched_on=watch))
            watch.rest(HEARTBEAT + 2 * REACTION + 0.2)
    except Hang as hang:
        outcome.ending = "hang"
        outcome.violations.append(str(hang))
        return outcome
    except Exception as problem:  # noqa: BLE001  whatever it is, it is a finding
        where = traceback.extract_tb(problem.__traceback__)[-1]
        outcome.ending = "crash"
        outcome.violations.append(f"{type(problem).__name__}: {problem} ({where})")
        return outcome
    outcome.ending = result.summary["outcome"]
    outcome.cause = result.summary["fault"] or ""
    outcome.violations += _check_files(result, folder)
    outcome.violations += _check_doubled(scenario, outcome.cause)
    outcome.violations += _check_friction(result, machine)
    outcome.violations += _check_stop(scenario, watch, folder, outcome.ending)
    outcome.struck = any(entry.count for entry in getattr(watch.world, "injected", ()))
    return outcome


@contextmanager
def _bound_of_wall_time() -> Iterator[None]:
    def ring(number: int, frame: FrameType | None) -> None:
        raise Hang(f"more than {WALL} s of wall time")

    before = signal.signal(signal.SIGALRM, ring)
    signal.alarm(WALL)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def _check_files(result: RunResult, folder: Path) -> list[str]:
    problems = []
    written = json.loads((folder / "summary.json").read_text())
    ending, cause = written["outcome"], written["fault"]
    if ending not in ("completed", "aborted", "fault"):
        problems.append(f"outcome {ending!r}")
    if ending == "fault" and not (cause and cause.startswith(("axis ", "bus ", "site "))):
        problems.append(f"cause is not named: {cause!r}")
    if (folder / "recording.journal").exists():
        problems.append("the journal was left")
    if result.recording is None:
        if (folder / "recording.h5").exists():
            problems.append("a recording without samples")
        return problems
    recording = read_recording(folder / "recording.h5")
    steps = np.diff(recording.time)
    if len(steps) and not (np.abs(steps / 1e-3 - np.round(steps / 1e-3)) < 1e-6).all():
        problems.append("samples off the SYNC grid")
    if len(steps) and steps.min() < 0.5e-3:
        problems.append("samples not in order")
    lost = sum(int((~signals.valid).sum()) for signals in recording.axes.values())
    if lost != written["cycle"]["missed"]:
        problems.append(f"{lost} samples marked as lost, {written['cycle']['missed']} counted")
    return problems


def _check_doubled(scenario: Scenario, cause: str) -> list[str]:
    """Frames doubled now and then, late or lost are no second device, and no second SYNC."""
    if "two devices have" not in cause and "a second SYNC" not in cause:
        return []
    plan = scenario.plan.faults
    made = [x for x in plan if isinstance(x, f.Duplicate) and x.frames.probability >= OFTEN]
    return [] if made else [f"frames were taken for doubled ones: {cause}"]


def _check_friction(result: RunResult, machine: Machine) -> list[str]:
    problems = []
    for entry in result.summary["friction"]:
        if not entry["accepted"]:
            continue
        truth = machine.axes[entry["axis"]].plant.friction
        for name, tolerance in TOLERANCE.items():
            found, true = entry["parameters"][name], getattr(truth, name)
            if not abs(found["value"] - true) <= tolerance * true + 3 * found["sigma"]:
                problems.append(
                    f"accepted for {entry['axis']} at site {entry['site']}: {name} "
                    f"{found['value']:.4g} +- {found['sigma']:.2g}, true is {true:.4g}"
                )
    return problems


def _check_stop(scenario: Scenario, watch: Watch, folder: Path, ending: str) -> list[str]:
    begun, last = _stop_begun(folder / "bus.asc")
    problems = []
    for node, until in watch.enabled_until.items():
        if watch.world is not None and until > watch.world.now_ns * 1e-9 - 0.01:
            problems.append(f"node {node} is enabled at the end")
        elif begun is not None and ending == "fault":
            silent = last + HEARTBEAT + 0.1 + REACTION
            bound = begun + REACTION if _reachable(scenario, node, begun) else silent
            if until > bound:
                problems.append(
                    f"node {node} enabled until {until:.3f} s, the stop began at {begun:.3f} s"
                )
    return problems


def _stop_begun(log: Path) -> tuple[float | None, float]:
    """When the host last sent any drive another command than to stay enabled, and its last frame.

    The log's times count from the first frame, which the host sends at power-on.
    """
    begun, last = None, 0.0
    for line in log.read_text().splitlines():
        parts = line.split()
        if len(parts) < 6 or parts[3] != "Tx":
            continue
        last = float(parts[0])
        if parts[2] in ("201", "202") and len(parts) > 7:
            word = int(parts[7] + parts[6], 16)
            if word & _ENABLE == _ENABLE:
                begun = None
            elif begun is None:
                begun = last
    return begun, last


def _reachable(scenario: Scenario, node: int, at: float) -> bool:
    """Whether the host's setpoints and SYNCs reach a node in the time after `at`."""
    end = at + REACTION
    for fault in scenario.plan.faults:
        if isinstance(fault, f.BusOff):
            if fault.node in (None, node) and fault.at < end and at < fault.at + fault.duration:
                return False
        elif isinstance(fault, f.FrameFault) and fault.frames.ids is not None:
            frames = fault.frames
            strikes = frames.ids & {0x80, 0x200 + node} and frames.probability >= 0.9
            if strikes and frames.after < end and at < frames.until:
                return False
    return True


def main() -> None:
    """Run the campaign and print what came of it."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--runs", type=int, default=2000, help="how many [2000]")
    parser.add_argument("--first", type=int, default=1, help="number of the first scenario [1]")
    parser.add_argument(
        "--friction-scale", type=float, default=1.0, help="of what the host starts from [1.0]"
    )
    parser.add_argument(
        "--retries", type=int, default=0, help="how often a site is begun again [0]"
    )
    arguments = parser.parse_args()
    from rich.console import Console
    from rich.progress import track

    from benchmarks.shared.machine_facts import machine_facts

    console = Console(stderr=True)
    machine = load_machine(None)
    recipe = parse_recipe(RECIPE, "four-sites.yaml", machine)
    make_compensation(machine, Mode.ESTIMATED)  # what is compiled has its own time
    begin = time.perf_counter()
    outcomes = []
    numbers = range(arguments.first, arguments.first + arguments.runs)
    for number in track(numbers, "fault campaign", console=console):
        with tempfile.TemporaryDirectory() as folder:
            outcome = run(
                make_scenario(number), machine, recipe, Path(folder),
                arguments.friction_scale, arguments.retries,
            )  # fmt: skip
        outcomes.append(outcome)
        if outcome.violations:
            print(describe(outcome), flush=True)
    print(table(outcomes))
    took = time.perf_counter() - begin
    struck = sum(o.struck for o in outcomes)
    print(
        f"\n{len(outcomes)} runs ({struck} with a fault that struck) in {took:.0f} s; "
        f"{machine_facts()}"
    )
    sys.exit(any(o.violations for o in outcomes))


def table(outcomes: list[Outcome]) -> str:
    """Outcomes by kind of fault, and every violation."""
    endings = sorted({o.ending for o in outcomes})
    lines = [
        f"| fault | runs | {' | '.join(endings)} | violations |",
        "| --- | " + "--- | " * (len(endings) + 2),
    ]
    kinds = sorted({kind for o in outcomes for kind in o.scenario.kinds})
    for kind in [*kinds, "all"]:
        chosen = [o for o in outcomes if kind == "all" or kind in o.scenario.kinds]
        count = Counter(o.ending for o in chosen)
        bad = sum(bool(o.violations) for o in chosen)
        cells = " | ".join(str(count[e]) for e in endings)
        lines.append(f"| {kind} | {len(chosen)} | {cells} | {bad} |")
    for o in outcomes:
        if o.violations:
            lines += ["", describe(o)]
    return "\n".join(lines)


def describe(outcome: Outcome) -> str:
    """A scenario, how it ended, and what there is to say against it."""
    lines = [str(outcome.scenario), f"  {outcome.ending}: {outcome.cause}"]
    return "\n".join(lines + [f"  {v}" for v in outcome.violations])


if __name__ == "__main__":
    main()
