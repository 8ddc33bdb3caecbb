"""Learning where the host's system wakes it late, as an ordinary kernel does; in virtual time."""

from __future__ import annotations

from datetime import UTC, datetime

import numpy as np
import pytest

from hil_sim.bus import LockstepBus, World
from hil_sim.stage import VirtualStage
from stagectl.config.settings.package_settings import stage_settings
from stagectl.recipe import make_fiducial, parse_recipe
from stagectl.run import HostSettings, Listener, RunRequest, SimulatedStage, Substitutes, execute

RECIPE = """\
recipe: slow
macro: {velocity: 0.1, acceleration: 3.0, jerk: 200.0}
micro: {velocity: 0.01, acceleration: 0.2, jerk: 20.0}
settle: {window: 5.0e-8, hold: 0.005, timeout: 0.15}
expose: 0.02
sites: [[0.004, -0.006], [0.015, 0.004], [0.0, 0.015], [-0.010, 0.0],
        [0.002, -0.008], [0.012, 0.006], [-0.004, 0.012], [0.008, -0.002]]
fiducial: {source: simulated, range: 80.0e-6, seed: 1}
"""


class Drowsy(World):
    """Time passes beyond what was asked for: by 20 us rms, every fiftieth time by far more.

    That is what was measured of SYNC over udp_multicast on two shared cores: 5 and 95 % at 79 and
    121 us, 1 % above 0.5 ms, two to four stalls of some periods in a run.
    """

    def __init__(self, name, seed):
        super().__init__(name)
        self._random = np.random.default_rng(seed)

    def sleep_until_ns(self, time_ns):
        late = 50.0 + 15.0 * self._random.standard_normal()
        luck = self._random.uniform()
        if luck < 0.02:
            late += self._random.exponential(150.0)
        if luck < 0.002:
            late += self._random.uniform(500.0, 4000.0)
        super().sleep_until_ns(time_ns + max(0, round(late * 1000.0)))


def test_a_host_that_is_woken_late_learns_the_friction(machine, tmp_path):
    seed = 1
    world, stage = Drowsy(f"drowsy-{seed}", seed), VirtualStage(stage_settings(machine), seed)
    stage.attach(world)
    recipe = parse_recipe(RECIPE, "slow.yaml", machine)
    request = RunRequest(
        recipe,
        machine,
        tmp_path,
        datetime.now(UTC),
        simulated=SimulatedStage(machine, seed),
        host=HostSettings(friction_scale=0.7, observer=False),
    )
    with LockstepBus(world.name) as bus:
        substitutes = Substitutes(bus, make_fiducial(recipe.fiducial))
        summary = execute(request, Listener(), substitutes).summary
    assert summary["outcome"] == "completed", summary["fault"]
    assert summary["cycle"]["late"] > 2
    estimates = summary["friction"]
    assert sum(e["accepted"] for e in estimates) > 0.8 * len(estimates)
    for axis, coulomb, stiffness in (("x", 6.0, 600e3), ("y", 9.0, 800e3)):
        learned = [e["parameters"] for e in estimates if e["axis"] == axis and e["accepted"]]
        # It wanders by 1 %, and the first moves cannot tell it from other forces.
        for p in learned:
            away = abs(p["coulomb"]["value"] - coulomb)
            assert away < max(0.04 * coulomb, 3.0 * p["coulomb"]["sigma"])
        assert learned[-1]["coulomb"]["value"] == pytest.approx(coulomb, rel=0.04)
        assert learned[-1]["stiffness"]["value"] == pytest.approx(stiffness, rel=0.04)
