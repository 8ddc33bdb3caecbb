"""Runs whose bus logs are replayed, and logs that are changed."""

import re

from hil_sim.bus import faults as f
from stagectl.run import HostSettings, Listener, SimulatedStage, execute
from tests.short_recipe import short_recipe
from tests.unit.stagectl.run.whole import request_for

RECIPE = short_recipe((0.004, -0.003), (0.01, 0.002))


def run(machine, folder, *faults, listener=None, retries=0):
    stage = SimulatedStage(machine, faults=f.FaultPlan(tuple(faults), 1))
    options = {"host": HostSettings(friction_scale=0.5), "retries": retries}
    request = request_for(machine, folder, RECIPE, simulated=stage, **options)
    return execute(request, listener or Listener())


def edit(path, pattern, replacement, occurrence):
    """Change one of the lines that match; returns the number of the frame in the log."""
    lines = path.read_text().splitlines(keepends=True)
    hits = [n for n, line in enumerate(lines) if re.search(pattern, line)]
    chosen = hits[occurrence]
    lines[chosen] = re.sub(pattern, replacement, lines[chosen])
    path.write_text("".join(lines))
    return chosen - 4  # five lines come before the first frame
