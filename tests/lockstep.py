"""A stage on virtual drives in lockstep, for the tests of `tests/hil` and of commissioning."""

import dataclasses
import itertools

from drivers.stage import Stage
from hil_sim.bus import FaultyWorld, World
from hil_sim.bus import faults as f
from hil_sim.stage import VirtualStage
from stagectl.config.settings.package_settings import driver_settings, stage_settings

_names = (f"lockstep-{n}" for n in itertools.count())


class Altered:
    """A node's connection on which `alter` makes of each frame's data what gets out, or None.

    A list is of as many frames.
    """

    def __init__(self, world, alter):
        self.world, self.alter = world, alter

    @property
    def now_ns(self):
        return self.world.now_ns

    def emit(self, can_id, data):
        altered = self.alter(can_id, data)
        if altered is not None:
            for frame in altered if isinstance(altered, list) else [altered]:
                self.world.emit(can_id, frame)

    def __getattr__(self, name):
        return getattr(self.world, name)


def switch_on(machine, *faults, alter=None, start=None, faulty=False, habits=None):
    """The machine's drives on a bus of their own, and that bus; `habits` are of the first."""
    settings = stage_settings(machine)
    if habits is not None:
        first, *others = settings.axes
        first = dataclasses.replace(first, habits=habits)
        settings = dataclasses.replace(settings, axes=(first, *others))
    drives = VirtualStage(settings, seed=1, start=start)
    if faults or faulty:
        world = FaultyWorld(next(_names), f.FaultPlan(faults))
        world.power_on(drives)
    else:
        world = World(next(_names))
        drives.attach(world if alter is None else Altered(world, alter))
    return drives, world


def open_on(world, machine, tap=None, bus=(), homing_method=37, **x):
    """A stage on this bus, with these settings of the bus and of axis x; it homes where it is."""
    bus_settings, axes = driver_settings(machine)
    if homing_method is not None:
        axes = [dataclasses.replace(axis, homing_method=homing_method) for axis in axes]
    channel = {"interface": "lockstep", "channel": world.name}
    return Stage.open(
        dataclasses.replace(bus_settings, **channel, **dict(bus)),
        [dataclasses.replace(axes[0], **x), *axes[1:]],
        tap,
    )


def open_stage(machine, *faults, alter=None, start=None, **settings):
    """A stage, its drives that have just been switched on, and their bus."""
    drives, world = switch_on(machine, *faults, alter=alter, start=start)
    return open_on(world, machine, **settings), drives, world


def power_up(stage):
    """Boots, homes and enables a stage."""
    stage.boot()
    stage.home()
    stage.enable()
    return stage
