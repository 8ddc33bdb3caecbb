"""Every number of a machine file at values that no stage has: refused in one line, or it works.

    python -m benchmarks.robustness.machine_values [--key PART ...] [--command NAME ...]
        [--bounds | --effects]

Each number of a machine file is set to each of `VALUES`, on both axes alike; each command then runs
in a process of its own. Required of a command: exit code 0, 2 or 3, at most one line per problem on
standard error, no traceback, no warning of Python or numpy, and, if the file is refused (2), its
name and the key. Violations are printed; `--all` prints every case. Exit code 1 if there are any.
"""

from __future__ import annotations

import argparse
import copy
import io
import os
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Iterator
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from hil_sim.effects.library import library, possible_on
from stagectl.config.machine.file import load_machine, parse_machine
from stagectl.config.machine.plausible import find_ranges
from stagectl.config.settings.package_settings import stage_settings
from stagectl.store import read_recording

VALUES: tuple[object, ...] = (
    1e-300, 1e-12, 1e12, 1e300, float("nan"), float("inf"), -1.0, 0.0, "abc", [], None,
)  # fmt: skip
LIMIT = 60
"""Seconds of wall time for one case."""

RECIPE = """\
recipe: short
macro: {velocity: 0.5, acceleration: 3.0, jerk: 200.0}
micro: {velocity: 0.01, acceleration: 0.2, jerk: 20.0}
settle: {window: 5.0e-8, hold: 0.005, timeout: 0.15}
expose: 0.02
sites: [[0.001, 0.001], [0.003, 0.002]]
fiducial: {source: simulated, range: 80.0e-6, seed: 1}
"""

DEFAULTS: dict[str, Any] = {
    "limits": {"following_error_time": 0.01, "position_window": 1e-6, "position_window_time": 0.01},
    "homing": {"velocity": 0.01, "index_velocity": 0.002},
    "drive": {
        "velocity_unit": 1e-9,
        "acceleration_unit": 1e-6,
        "position_unit": 1e-9,
        "boot_timeout": 2.0,
        "enable_timeout": 2.0,
        "quirks": {
            "offset_delay": 0,
            "offset_step": 0.0,
            "position_delay": 0,
            "position_filter": 0.0,
        },
    },
}
"""Numbers that a file may leave out."""
CASCADE = {
    "position_gain": 120.0, "velocity_gain": 2700.0, "velocity_integral": 1e5,
    "feedforward": 1.0, "derivative_time": 1e-4,
}  # fmt: skip

Path_ = tuple[str | int, ...]


@dataclass(frozen=True)
class Case:
    """One number at one value.

    Attributes:
        key: of the number, below an axis or from the top.
        value: what it is made.
        text: of the machine file.
    """

    key: str
    value: object
    text: str


def machine_with(cascade: bool) -> dict[str, Any]:
    """The packaged machine with every number written out."""
    machine: dict[str, Any] = _read(yaml.safe_load(load_machine(None).text))
    machine["bus"]["sync_window"] = 0.0
    machine["temperature"] = {"axis": "x", "object": "0x6064:00", "scale": 1.0, "offset": 0.0}
    for axis in machine["axes"].values():
        for section, numbers in DEFAULTS.items():
            axis.setdefault(section, {}).update(copy.deepcopy(numbers))
        if cascade:
            del axis["drive"]["pid"]
            axis["drive"]["cascade"] = dict(CASCADE)
    return machine


def _read(node: Any) -> Any:
    """YAML 1.1 takes 6.0e5 for a text."""
    if isinstance(node, dict):
        return {key: _read(value) for key, value in node.items()}
    if isinstance(node, list):
        return [_read(value) for value in node]
    try:
        return float(node) if isinstance(node, str) else node
    except ValueError:
        return node


def cases(parts: list[str], bounds: bool) -> Iterator[Case]:
    """All cases whose key has one of these parts; with `bounds` at what is just allowed."""
    for cascade in (False, True):
        machine = machine_with(cascade)
        name, axis = next(iter(machine["axes"].items()))
        parsed = parse_machine(yaml.safe_dump(machine), "all numbers").axes[name]
        ranges = {".".join(path): limit[:2] for path, _, limit in find_ranges(parsed)}
        found = [(("bus", *p), False) for p in _numbers(machine["bus"])]
        found += [(("temperature", *p), False) for p in _numbers(machine["temperature"])]
        found += [(p, True) for p in _numbers(axis)]
        for path, of_axis in found:
            key = ".".join(map(str, path))
            if (cascade and "cascade" not in key) or not any(part in key for part in parts):
                continue
            for value in ranges.get(key, ()) if bounds else VALUES:
                changed = copy.deepcopy(machine)
                for root in changed["axes"].values() if of_axis else [changed]:
                    place = root
                    for step in path[:-1]:
                        place = place[step]
                    place[path[-1]] = copy.copy(value)
                yield Case(key, value, yaml.safe_dump(changed))


def effects() -> Iterator[Case]:
    """The same of every number of every effect, the others amid their usual range."""
    machine = machine_with(cascade=False)
    axes = stage_settings(load_machine(None)).axes
    for name, effect in possible_on(axes[0], library()).items():
        usual = {p.key: sum(p.ranges(axes[0])[-1]) / 2.0 for p in effect.parameters}
        for key in usual:
            for value in VALUES:
                changed = copy.deepcopy(machine)
                for axis in changed["axes"].values():
                    figures = usual | {key: copy.copy(value)}
                    axis["effects"] = [{"effect": name, **figures}]
                yield Case(f"{name}.{key}", value, yaml.safe_dump(changed))


def _numbers(node: object) -> Iterator[Path_]:
    """Where numbers that are no whole ones stand."""
    items = node.items() if isinstance(node, dict) else enumerate(node)  # type: ignore[arg-type]
    for name, value in items:
        if isinstance(value, float):
            yield (name,)
        elif isinstance(value, (dict, list)):
            yield from ((name, *rest) for rest in _numbers(value))


def attempt(arguments: list[str], folder: Path) -> tuple[int, str]:
    """Exit code and standard error of a command, run in a process of its own."""
    errors = folder / "stderr"
    child = os.fork()
    if child == 0:
        signal.alarm(LIMIT)
        with errors.open("w") as stream, Path(os.devnull).open("w") as nowhere:
            os.dup2(stream.fileno(), 2)
            with redirect_stdout(nowhere), redirect_stderr(stream):
                code = command(arguments)
            stream.flush()
        os._exit(code)
    _, status = os.waitpid(child, 0)
    return os.waitstatus_to_exitcode(status), errors.read_text()


def command(arguments: list[str]) -> int:
    """As the program does it; a traceback is 99."""
    from stagectl.cli import main

    sys.argv = ["stagectl", *arguments]
    try:
        main()
    except SystemExit as ended:
        return ended.code if isinstance(ended.code, int) else 0
    except BaseException:  # noqa: BLE001  whatever it is, it is a finding
        traceback.print_exc()
        return 99
    return 0


def problem(code: int, errors: str, case: Case) -> str | None:
    """What a command did that it should not."""
    lines = [line for line in errors.splitlines() if line.strip()]
    if code == -signal.SIGALRM:
        return f"more than {LIMIT} s"
    if code not in (0, 2, 3):
        return f"ended with {code}"
    if "Warning" in errors or "Traceback" in errors:
        return "a warning of Python's"
    if code == 2:
        if any(".yaml:" not in line for line in lines) or len(lines) > 8:
            return "not one line with the file's name for each axis"
        if not any(_named(case.key, line) for line in lines):
            return "the key is not named"
    if code == 3 and len(lines) > 8:
        return "more than a line"
    return None


def _named(key: str, line: str) -> bool:
    """Whether a line names the key; or the recipe's, or the effect's, what the key makes of it."""
    last = next(part for part in reversed(key.split(".")) if not part.isdigit())
    whole = ("stagectl: short.yaml", "too stiff", "too much")
    return last in line or any(text in line for text in whole)


def main() -> None:
    """Go through all cases."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--key", nargs="*", default=[""], help="parts of keys [all]")
    parser.add_argument("--command", nargs="*", default=["run", "identify", "measure"])
    parser.add_argument("--bounds", action="store_true", help="least and greatest values allowed")
    parser.add_argument("--effects", action="store_true", help="numbers of effects instead")
    parser.add_argument("--all", action="store_true", help="print every case")
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        os.chdir(folder)
        (folder / "short.yaml").write_text(RECIPE)
        commands = {
            "run": ["run", "short.yaml", "--machine", "m.yaml", "--simulate", "--out", "out",
                    "--history", "stage.db"],
            "identify": ["identify", "sound/recording.h5", "--machine", "m.yaml"],
            "measure": ["gap", "measure", "sound/recording.h5", "--machine", "m.yaml"],
        }  # fmt: skip
        (folder / "m.yaml").write_text(load_machine(None).text)
        commands["run"][6] = "sound"
        with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
            for arguments in commands.values():  # once here: every case finds what it compiles
                command(arguments)
        commands["run"][6] = "out"
        read_recording(folder / "sound" / "recording.h5")
        count, findings, begin = 0, 0, time.monotonic()
        made = effects() if chosen.effects else cases(chosen.key, chosen.bounds)
        for case in made:
            (folder / "m.yaml").write_text(case.text)
            for which in chosen.command:
                code, errors = attempt(commands[which], folder)
                found = problem(code, errors, case)
                count, findings = count + 1, findings + (found is not None)
                if found or chosen.all:
                    lines = [line for line in errors.splitlines() if line.strip()]
                    print(f"{case.key} = {case.value!r}: {which}: {code}: {found or 'good'}")
                    for line in lines if len(lines) < 4 else [lines[0], "...", lines[-1]]:
                        print(f"    {line[:200]}", flush=True)
    print(f"{count} cases, {findings} findings, {time.monotonic() - begin:.0f} s")
    sys.exit(bool(findings))


if __name__ == "__main__":
    main()
