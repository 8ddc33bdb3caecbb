"""Whole runs on the virtual stage that end soon, or go wrong where a test wants it."""

from datetime import UTC, datetime

from stagectl.recipe import parse_recipe
from stagectl.run import Listener, RunRequest, SimulatedStage
from stagectl.sequencer import MoveStarted
from tests.short_recipe import short_recipe

HEAD = """\
recipe: short
macro: {velocity: 0.5, acceleration: 3.0, jerk: 200.0}
micro: {velocity: 0.01, acceleration: 0.2, jerk: 20.0}
settle: {window: 5.0e-8, hold: 0.005, timeout: 0.15}
"""
SITES = short_recipe((0.004, -0.003), (0.02, 0.01), (0.0, 0.02), (-0.015, 0.0), (0.01, 0.01))
MOVES = HEAD + (
    "moves: [{to: [0.01, 0.0]}, {reverse: 100 um, axis: x}, {dwell: 50 ms},"
    " {reverse: 200 um, axis: x}, {to: [0.0, 0.005]}]\nfiducial: {source: none}\n"
)
ONE_SITE = short_recipe((0.004, 0.0))
FOLLOWING, OVER_CURRENT = 0x8611, 0x2310


def request_for(machine, folder, text=ONE_SITE, **changes):
    """To run a recipe on the virtual stage."""
    given = {
        "recipe": parse_recipe(text, "short.yaml", machine), "machine": machine, "folder": folder,
        "started": datetime.now(UTC), "simulated": SimulatedStage(machine),
    }  # fmt: skip
    return RunRequest(**{**given, **changes})


def failing_at(move, code=FOLLOWING, times=1):
    """Listens to a run and has drive y fail in the middle of a move (counted from 1)."""
    stages, begun = [], 0

    def event(happened):
        nonlocal begun
        if isinstance(happened, MoveStarted):
            begun += 1
            if move <= begun < move + times:
                drive, world = stages[0].drives[1], stages[1]
                world.at(world.now_ns + 5_000_000, lambda: drive.inject_fault(code))

    return Listener(event=event, switched_on=lambda *both: stages.extend(both)), stages
