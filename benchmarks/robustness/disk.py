"""What a run costs on disk: size of its files and of what it needs while it goes on.

    python -m benchmarks.robustness.disk --minutes 60

Two axes at 1 kHz on the virtual stage, moving a third of the time.
"""

from __future__ import annotations

import argparse
import tempfile
import threading
from datetime import UTC, datetime
from pathlib import Path

from stagectl.config import load_machine
from stagectl.recipe import parse_recipe
from stagectl.run import HostSettings, Listener, RunRequest, SimulatedStage, execute
from stagectl.sequencer import Mode

RECIPE = """recipe: disk
macro: {{velocity: 0.5, acceleration: 3.0, jerk: 200.0}}
micro: {{velocity: 0.01, acceleration: 0.2, jerk: 20.0}}
settle: {{window: 5.0e-8, hold: 0.005, timeout: 0.15}}
moves:
  - repeat: {repeat}
    moves: [{{to: [0.03, 0.02]}}, {{to: [0.0, 0.0]}}, {{dwell: 1.5}}]
"""
ROUND = 2.0  # s, one repetition


def main() -> None:
    """Run, and print the sizes."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--minutes", type=float, default=60.0)
    minutes = options.parse_args().minutes
    machine = load_machine()
    recipe = parse_recipe(RECIPE.format(repeat=round(minutes * 60 / ROUND)), "disk.yaml", machine)
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "run"
        peak, over = 0, threading.Event()

        def watch() -> None:
            nonlocal peak
            while not over.wait(0.5):
                peak = max(peak, size(folder))

        watcher = threading.Thread(target=watch)
        watcher.start()
        request = RunRequest(
            recipe,
            machine,
            folder,
            datetime.now(UTC),
            simulated=SimulatedStage(machine),
            host=HostSettings(mode=Mode.MODEL),
        )
        result = execute(request, Listener())
        over.set()
        watcher.join()
        seconds = result.summary["duration"]
        end = f"{size(folder) / 1e6:.0f} MB, at most {peak / 1e6:.0f} MB meanwhile"
        print(f"{seconds:.0f} s: {end}")
        for path in sorted(folder.iterdir()):
            print(f"  {path.name:18} {path.stat().st_size / 1e6:8.1f} MB")


def size(folder: Path) -> int:
    """Size of the files in a folder [bytes]."""
    total = 0
    for path in folder.glob("*"):
        try:
            total += path.stat().st_size
        except OSError:  # just removed
            continue
    return total


if __name__ == "__main__":
    main()
