"""Arbitrary frames and damaged files: nothing may crash, hang or move.

    python -m benchmarks.robustness.fuzz [--seconds 60] [--target NAME ...] [--first 1]
        [--keep FOLDER]

Each case depends on its number alone. Files are edited (bytes changed, cut out, doubled, moved,
lines swapped); frames come from another sender on the bus. Required of each target:

- `drive`: frames to both virtual drives, mostly to identifiers they listen to, none with the
  command "enable operation": nothing is raised, and no axis is powered.
- `driver`: frames among those of the drives while the host boots, homes and streams: it continues
  or ends with an error that names axis or bus; then no drive is enabled.
- `eds`, `machine`, `recipe`, `faults`: read, or refused in lines that name the file.
- `recording`: damaged HDF5: read, or refused in one line; in a process of its own, since the HDF5
  library may crash.
- `journal`, `bus log`, `frames`: read, recovered up to the damage, or refused.

Failures are printed with their number, and their input is kept in FOLDER. Exit code 1 if there are
any.
"""

from __future__ import annotations

import argparse
import multiprocessing
import signal
import struct
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from types import FrameType

import can
import numpy as np

from benchmarks.robustness.fuzz_input import (
    AT_DRIVER,
    AT_DRIVES,
    Frame,
    calm,
    edited,
    random_edits,
    random_frames,
)
from drivers.canopen import load_dictionary
from drivers.errors import DriverError
from drivers.settings import HOST_NODE
from drivers.stage import Stage
from hil_sim.bus import World
from hil_sim.cia301 import EDS_PATH
from hil_sim.cia402 import State
from hil_sim.stage import VirtualStage
from stagectl.config.faults import parse_faults
from stagectl.config.machine import Machine
from stagectl.config.machine.file import load_machine, parse_machine
from stagectl.config.settings.package_settings import driver_settings, stage_settings
from stagectl.errors import ConfigError, StagectlError
from stagectl.recipe import parse_recipe
from stagectl.store import (
    AxisScaling,
    BusLog,
    CycleLedger,
    Journal,
    JournalHeader,
    RunNotes,
    read_ledger,
    read_log,
    read_notes,
    read_recording,
    recover_journal,
    recover_log,
    sample_dtype,
    write_recording,
)
from stagectl.store.frame_spool import HEAD, MAGIC, FrameSpool
from stagedata import AxisSignals, Move, Recording

ROOT = Path(__file__).parents[2]
LIMIT = 20
"""Seconds of wall time for one case."""
LONGEST = 400.0
"""Bound of virtual time for one case [s]; a homing alone is given 300 s by its axis' travel."""


class Hang(Exception):  # noqa: N818
    """A bound of time was passed."""


@dataclass(frozen=True)
class Finding:
    """A case that violates its requirements.

    Attributes:
        target, number: of the case.
        problem: what happened.
    """

    target: str
    number: int
    problem: str


@cache
def machine() -> Machine:
    """The packaged machine."""
    return load_machine(None)


# -- frames -------------------------------------------------------------------------------------


def strike_drives(frames: Sequence[Frame], name: str = "fuzz") -> None:
    """Send frames to both drives.

    Raises:
        AssertionError: an axis came under power.
    """
    world = World(name)
    stage = VirtualStage(stage_settings(machine()), 1)
    stage.attach(world)
    enabled = False
    with can.Bus(interface="lockstep", channel=name) as bus:
        bus.clock.sleep_until_ns(30_000_000)
        for can_id, data in frames:
            bus.send(can.Message(arbitration_id=can_id, data=data, is_extended_id=False))
            bus.clock.sleep_until_ns(bus.clock.now_ns() + 1_000_000)
            while bus.recv(0) is not None:
                pass
            enabled |= any(drive.motion.state is State.ENABLED for drive in stage.drives)
            for drive in stage.drives:
                drive.motor.position()
    assert not enabled, "an axis came under power"


def strike_driver(frames: Sequence[Frame], moments: Sequence[float], name: str = "fuzz") -> str:
    """Let somebody else send frames while the host boots, homes and streams.

    Args:
        frames: to be sent.
        moments: when, in virtual time [s].
        name: of the bus.

    Returns:
        How the host ended: "done", or the class of its error.

    Raises:
        AssertionError: a drive is left enabled.
    """
    world = World(name)
    stage = VirtualStage(stage_settings(machine()), 1, start=(1e-4, 1e-4))
    stage.attach(world)
    bus, axes = driver_settings(machine())
    rogue = object()

    def send(frame: Frame) -> Callable[[], None]:
        return lambda: world.transmit(rogue, *frame)

    for frame, moment in zip(frames, moments, strict=True):
        world.at(round(moment * 1e9), send(frame))
    watch = _Watch(world)
    ending = "done"
    try:
        with Stage.open(replace(bus, interface="lockstep", channel=name), axes) as host:
            host.boot()
            host.home()
            host.enable()
            demand = np.tile(host.targets, (300, 1))
            host.stream(demand, np.zeros_like(demand))
            host.disable()
    except DriverError as refused:
        _one_line(refused, "axis ", "bus ", "node ")
        ending = type(refused).__name__
    watch.until_ns = 1 << 62
    world.sleep_until_ns(world.now_ns + 1_000_000_000)  # those that were not reached miss the host
    left = [drive.node_id for drive in stage.drives if drive.motion.state is State.ENABLED]
    assert not left, f"nodes {left} are left enabled"
    return ending


class _Watch:
    """Ends a case that goes on for ever in virtual time."""

    def __init__(self, world: World) -> None:
        self.until_ns = round(LONGEST * 1e9)
        self._world = world
        self._look()

    def _look(self) -> None:
        if self._world.now_ns > self.until_ns:
            raise Hang(f"more than {LONGEST:g} s of virtual time")
        self._world.at(self._world.now_ns + 1_000_000_000, self._look)


def _drive(random: np.random.Generator, folder: Path) -> None:
    frames = [(0x000, b"\x01\x00"), *random_frames(random, AT_DRIVES, 200)]
    strike_drives([calm(frame) for frame in frames], f"fuzz-{folder.name}")


def _driver(random: np.random.Generator, folder: Path) -> None:
    count = int(random.integers(1, 40))
    begin = float(random.choice([0.0, 0.0, 0.1, 0.5]))
    moments = np.sort(random.uniform(begin, begin + float(random.choice([0.05, 0.5, 2.0])), count))
    strike_driver(random_frames(random, AT_DRIVER, count), moments.tolist(), f"fuzz-{folder.name}")


# -- files --------------------------------------------------------------------------------------


def read_eds(data: bytes, folder: Path) -> None:
    """As the driver does."""
    path = folder / "drive.eds"
    path.write_bytes(data)
    _, axes = driver_settings(machine())
    settings = replace(axes[0], eds=path)
    try:
        load_dictionary(settings)
        bus = World(f"eds-{folder.name}")
        Stage.open(
            replace(driver_settings(machine())[0], interface="lockstep", channel=bus.name),
            (settings,),
        ).close()
    except DriverError as refused:
        _one_line(refused, "drive.eds", "axis x: ")


def read_text(parse: Callable[[str, str], object], data: bytes, name: str) -> None:
    """As a file is read: what is no UTF-8 is refused before."""
    try:
        text = data.decode()
    except UnicodeDecodeError:
        return
    try:
        parse(text, name)
    except ConfigError as refused:
        for problem in refused.problems:
            assert name in problem, problem
            assert "\n" not in problem, problem


def read_files(data: bytes, folder: Path, name: str, *readers: Callable[[Path], object]) -> None:
    """Each reader reads the file, or refuses it in one line that names it."""
    for reader in readers:
        path = folder / name
        path.write_bytes(data)
        try:
            reader(path)
        except StagectlError as refused:
            _one_line(refused, name)


def _one_line(refused: Exception, *names: str) -> None:
    text = str(refused)
    if "\n" in text or not any(name in text for name in names):
        raise AssertionError(f"message that does not say what it is about: {text!r}")


@cache
def sound(what: str) -> bytes:
    """The undamaged file."""
    match what:
        case "eds":
            return EDS_PATH.read_bytes()
        case "machine":
            return machine().text.encode()
        case "recipe":
            return (ROOT / "recipes" / "inspection-20.yaml").read_bytes()
        case "faults":
            return (ROOT / "examples" / "faults.yaml").read_bytes()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        return _written(what, folder)


def _written(what: str, folder: Path) -> bytes:
    started = datetime(2026, 1, 1, tzinfo=UTC)
    if what == "frames":
        spool = FrameSpool(folder / "bus.frames", HEAD.pack(MAGIC, 0, HOST_NODE))
        for k in range(200):
            spool.append(k * 1_000_000, 0x181 + k % 2, struct.pack("<Hih", k, -k, k))
        spool.close()
        return (folder / "bus.frames").read_bytes()
    if what == "bus log":
        with BusLog(folder / "bus.asc", started) as log:
            for k in range(200):
                log.tap(k * 1_000_000, 0x181 + k % 2, struct.pack("<Hih", k, -k, k))
        return log.path.read_bytes()
    if what == "journal":
        axes = tuple(AxisScaling(name, 1e-9, 0.1) for name in ("x", "y"))
        header = JournalHeader("m", "r", started.isoformat(), axes)
        fields = len(sample_dtype(len(axes)).names or ())  # with tag, index and CRC
        with Journal(folder, header) as journal:
            journal.event("run", seed=1)
            journal.move(Move("macro", 0, 90, {"x": 0.0, "y": 0.0}, {"x": 1.0, "y": 0.0}, 1))
            for k in range(100):
                journal.sink((k * 1_000_000, *[k % 2] * (fields - 4)))
            return journal.path.read_bytes()
    count = 200
    signals = AxisSignals(
        *(np.linspace(0.0, 1.0, count) for _ in range(4)),
        np.full(count, 0x1237, np.uint16), np.ones(count, np.bool_),
    )  # fmt: skip
    recording = Recording(
        machine().text, "recipe", started.isoformat(), np.arange(count) * 1e-3,
        {"x": signals, "y": signals},
        (Move("macro", 0, 90, {"x": 0.0, "y": 0.0}, {"x": 1.0, "y": 0.0}, 1),), "",
    )  # fmt: skip
    ledger = CycleLedger({"x": np.zeros(count)}, np.zeros(count, np.bool_))
    path = folder / "recording.h5"
    notes = RunNotes("recipe", machine().text, "", "fault", ({"event": "run", "seed": 1},))
    write_recording(recording, path, ledger, notes)
    return path.read_bytes()


def _text_target(what: str, parse: Callable[[str, str], object]) -> Target:
    def attempt(random: np.random.Generator, folder: Path) -> None:
        read_text(parse, edited(sound(what), random_edits(random)), f"{what}.yaml")

    return attempt


def _file_target(what: str, name: str, *readers: Callable[[Path], object]) -> Target:
    def attempt(random: np.random.Generator, folder: Path) -> None:
        read_files(edited(sound(what), random_edits(random)), folder, name, *readers)

    return attempt


def _eds(random: np.random.Generator, folder: Path) -> None:
    read_eds(edited(sound("eds"), random_edits(random)), folder)


def _recording(random: np.random.Generator, folder: Path) -> None:
    data = edited(sound("recording"), random_edits(random))
    (folder / "input").write_bytes(data)
    child = multiprocessing.get_context("fork").Process(target=_read_recording, args=(data, folder))
    child.start()
    child.join(LIMIT)
    if child.is_alive():
        child.kill()
        child.join()
        raise Hang(f"more than {LIMIT} s")
    assert child.exitcode == 0, f"the reading process ended with {child.exitcode}"


def _read_recording(data: bytes, folder: Path) -> None:
    read_files(data, folder, "recording.h5", read_recording, read_ledger, read_notes)


Target = Callable[[np.random.Generator, Path], None]

TARGETS: dict[str, Target] = {
    "drive": _drive,
    "driver": _driver,
    "eds": _eds,
    "machine": _text_target("machine", parse_machine),
    "recipe": _text_target("recipe", lambda text, name: parse_recipe(text, name, machine())),
    "faults": _text_target("faults", lambda text, name: parse_faults(text, name, machine(), 1)),
    "recording": _recording,
    "journal": _file_target("journal", "recording.journal", recover_journal),
    "bus log": _file_target("bus log", "bus.asc", read_log),
    "frames": _file_target("frames", "bus.frames", lambda path: recover_log(path.parent)),
}


def attempt(target: str, number: int, folder: Path) -> Finding | None:
    """One case.

    Args:
        target: of `TARGETS`.
        number: of the case.
        folder: empty, for its files.
    """
    random = np.random.default_rng((0x46555A5A, list(TARGETS).index(target), number))
    try:
        with _bound_of_wall_time():
            TARGETS[target](random, folder)
    except Exception as problem:  # noqa: BLE001  whatever it is, it is a finding
        place = traceback.extract_tb(problem.__traceback__)[-1]
        where = f"{Path(place.filename).name}:{place.lineno}"
        return Finding(target, number, f"{type(problem).__name__}: {problem} ({where})")
    return None


@contextmanager
def _bound_of_wall_time() -> Iterator[None]:
    def ring(number: int, frame: FrameType | None) -> None:
        raise Hang(f"more than {LIMIT} s of wall time")

    before = signal.signal(signal.SIGALRM, ring)
    signal.alarm(LIMIT + 2)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def main() -> None:
    """Go through cases for a time and print what was found."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seconds", type=float, default=60.0, help="in all [60]")
    parser.add_argument("--first", type=int, default=1, help="number of the first case [1]")
    parser.add_argument("--target", nargs="*", default=list(TARGETS), choices=list(TARGETS))
    parser.add_argument("--keep", type=Path, help="folder for the inputs of what fails")
    arguments = parser.parse_args()
    from benchmarks.shared.machine_facts import machine_facts

    done = dict.fromkeys(arguments.target, 0)
    findings: list[Finding] = []
    for target in arguments.target:
        deadline = time.monotonic() + arguments.seconds / len(arguments.target)
        while time.monotonic() < deadline:
            number = arguments.first + done[target]
            with tempfile.TemporaryDirectory() as name:
                found = attempt(target, number, Path(name))
                if found is not None:
                    findings.append(found)
                    print(f"{found.target} {found.number}: {found.problem}", flush=True)
                    if arguments.keep:
                        kept = arguments.keep / f"{target}-{number}"
                        kept.mkdir(parents=True, exist_ok=True)
                        for path in Path(name).iterdir():
                            path.replace(kept / path.name)
            done[target] += 1
    print("| target | cases | findings |\n| --- | --- | --- |")
    for target, count in done.items():
        print(f"| {target} | {count} | {sum(f.target == target for f in findings)} |")
    print(f"\n{arguments.seconds:g} s; {machine_facts()}")
    sys.exit(bool(findings))


if __name__ == "__main__":
    main()
