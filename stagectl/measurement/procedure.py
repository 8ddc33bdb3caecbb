"""Measures an enabled stage: plans the experiment, runs it, and notes whose response it is."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import datetime

from drivers import NodeError, Stage
from drivers.objects import ObjectRef
from stagectl.config.machine import Machine
from stagectl.config.settings.package_settings import driver_settings
from stagectl.errors import Aborted, drivers_failures
from stagectl.measurement.document import Identity, MeasuredAxis, Measurement, settings_of
from stagectl.measurement.experiment import Experiment

IDENTITY = 0x1018


def measure_stage(
    stage: Stage,
    machine: Machine,
    measured: datetime | None = None,
    agreed: Callable[[list[str]], bool] = lambda _: True,
    stop: Callable[[], bool] = lambda: False,
    progress: Callable[[float], object] = lambda _: None,
) -> Measurement:
    """Measure the responses of a stage.

    Args:
        stage: enabled in csp, at rest.
        machine: as the host believes it.
        measured: time of a real measurement; None for a simulated one.
        agreed: called with what each axis will do; False ends the measurement before it begins.
        stop: asked at every SYNC; True ends the measurement.
        progress: called with the share that is done.

    Raises:
        RunFault: a limit was exceeded.
        Aborted: it was stopped, or not agreed to.
        UnusableInput: as `Experiment`.
        DriverError: from the stage.
    """
    offers = [axis.accepts_force_offset for axis in stage.axes]
    planned = Experiment(machine, stage.targets, offers)
    stated = [bounds.describe(machine.axes[bounds.name].rotary) for bounds in planned.bounds]
    if not agreed([*stated, f"for {planned.duration:.0f} s"]):
        raise Aborted("not measured")
    responses = planned.run(stage, stop, progress)
    identities = identify(stage) if measured is not None else {}
    period = machine.bus.sync_period
    axes = {
        name: MeasuredAxis(identities.get(name), settings_of(machine.axes[name], period), response)
        for name, response in responses.items()
    }
    moment = None if measured is None else measured.isoformat(timespec="seconds")
    return Measurement(moment, machine.name, axes)


def measure_on_bus(
    machine: Machine,
    bus: tuple[str, str] | None,
    agreed: Callable[[list[str]], bool],
    measured: datetime,
    stop: Callable[[], bool],
    progress: Callable[[float], object],
) -> Measurement:
    """Boot, home and enable the stage on a bus, measure it, and disable it.

    Args:
        machine: as the host believes it.
        bus: (interface, channel) in place of the machine's.
        agreed: as of `measure_stage`.
        measured: now.
        stop: as of `measure_stage`.
        progress: as of `measure_stage`; takes the share done.

    Raises:
        UnusableInput: there is no such bus, or no axis that can be measured.
        RunFault: bus, node or axis failed, or a limit was exceeded.
        Aborted: it was stopped, or not agreed to.
    """
    with ready_stage(machine, bus) as stage:
        return measure_stage(stage, machine, measured, agreed, stop, progress)


@contextmanager
def ready_stage(machine: Machine, bus: tuple[str, str] | None) -> Iterator[Stage]:
    """A stage that is booted, homed and enabled, and disabled in the end.

    Args:
        machine: as the host believes it.
        bus: (interface, channel) in place of the machine's.

    Raises:
        UnusableInput: there is no such bus.
        RunFault: bus, node or axis failed.
    """
    with drivers_failures(), Stage.open(*driver_settings(machine, bus)) as stage:
        stage.boot()
        stage.require_csp()
        stage.home()
        stage.enable()
        yield stage
        stage.disable()


def identify(stage: Stage) -> dict[str, Identity]:
    """The identity of each axis' drive; what an object lacks is None.

    Raises:
        DriverError: the bus fails.
    """
    found = {}
    for axis in stage.axes:
        values: dict[str, int | None] = {}
        for sub, name in enumerate(Identity.model_fields, 1):
            try:
                values[name] = int(axis.node.read(ObjectRef(IDENTITY, sub, "identity")))
            except NodeError:
                values[name] = None
        found[axis.name] = Identity(**values)
    return found
