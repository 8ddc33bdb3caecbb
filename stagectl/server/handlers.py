"""What a server answers: `answer` a request by the function that is named as its operation.

Each takes the service, the command and the request around it, and returns plain values, a message,
or a `Later`.
"""

from __future__ import annotations

import sys
import time
import traceback
from typing import Any

from drivers.canopen import Node
from drivers.objects import ObjectRef
from stagectl.errors import ConfigError, StagectlError
from stagectl.protocol import requests as ask
from stagectl.protocol.state import Job, Notice, Refusal, ServerInfo, State
from stagectl.recipe import dry_run, parse_recipe
from stagectl.server import motions
from stagectl.server.motions import JOG_MOST, JogDemand, checked_velocity
from stagectl.server.running import asked_recipe
from stagectl.server.service import Later, RefusedError, Reply, Service
from stagectl.server.setup import setup_for

LISTENED = 10.0
"""How long frames are published after a request for them [s]."""
_READS = (2, 3, 4, 5)
"""Client command specifiers of SDO that write nothing: upload, its segments and blocks, abort."""


def answer(service: Service, request: ask.Request, reply: Reply) -> None:
    """Answer a request, now or later."""
    command = request.command
    try:
        if isinstance(command, ask.FREE):
            service.lease.renew(request.lease)
        else:
            service.require_command(request.lease)
        result: Any = globals()[command.op](service, command, request)
    except RefusedError as why:
        result = why.refusal
    except ConfigError as why:
        result = Refusal(kind="input", text=why.problems[0], problems=why.problems)
    except StagectlError as why:
        result = Refusal(kind="input", text=" ".join(str(why).split()))
    except Exception as why:  # noqa: BLE001  the stage must not suffer from it
        traceback.print_exc(file=sys.stderr)
        result = Refusal(kind="internal", text=f"internal error: {type(why).__name__}: {why}")
    if callable(result):
        result(reply)
    else:
        reply(result)


def info(service: Service, *_: object) -> ServerInfo:
    """Who serves."""
    return service.info()


def state(service: Service, *_: object) -> State:
    """The present state."""
    return service.state()


def events(service: Service, command: ask.GetEvents, *_: object) -> list[Notice]:
    """What has happened since a number."""
    return service.notices.since(command.since)


def wait(service: Service, command: ask.Wait, *_: object) -> Later:
    """Answered when a job has ended."""
    if service.jobs.find(command.job) is None:
        raise RefusedError("unknown", f"there is no job {command.job}")
    return lambda reply: service.jobs.wait(command.job, command.timeout, reply)


def take(service: Service, command: ask.Take, request: ask.Request) -> dict[str, str]:
    """Take command."""
    if not command.force:
        service.require_command(request.lease)
    holder = {"holder": request.client}
    service.notices.say("lease", f"{request.client} commands the stage", holder)
    return {"lease": service.lease.take(request.client)}


def release(service: Service, _: object, request: ask.Request) -> dict[str, bool]:
    """Give command back."""
    released = service.lease.release(request.lease)
    if released:
        service.notices.say("lease", "nobody commands the stage", {"holder": None})
    return {"released": released}


def acknowledge(
    service: Service, command: ask.Acknowledge, request: ask.Request
) -> dict[str, bool]:
    """Acknowledge an alarm."""
    alarm = service.alarms.acknowledge(command.alarm, request.client)
    if alarm is None:
        raise RefusedError("unknown", f"there is no open alarm {command.alarm}")
    text = f"acknowledged by {request.client}: {alarm.text}"
    service.notices.say("alarm", text, {"id": alarm.id})
    return {"acknowledged": True}


def stop(service: Service, command: ask.Stop, request: ask.Request) -> dict[str, bool]:
    """Stop whatever is under way."""
    reason = _reason(command, request)
    service.keeper.stop(reason)
    service.runner.abort(reason)
    service.notices.say("stopping", reason)
    return {"pressed": True}


def _reason(command: ask.Stop | ask.Abort, request: ask.Request) -> str:
    return f"stopped by {request.client}" + (f": {command.reason}" if command.reason else "")


def enable(service: Service, command: ask.Enable, *_: object) -> Job:
    """Enable all axes."""
    motions = service.motions
    return service.begin("enabling", "enabling", lambda stage: motions.enable(stage, command.reset))


def disable(service: Service, *_: object) -> Job:
    """Switch all axes off."""
    return service.begin("stopping", "disabling", lambda stage: stage.disable())


def home(service: Service, command: ask.Home, *_: object) -> Job:
    """Home the axes."""
    force, reset = command.force, command.reset
    return service.begin(
        "homing", "homing", lambda stage: service.motions.home(stage, force, reset)
    )


def move(service: Service, command: ask.Move, *_: object) -> Job:
    """Move an axis."""
    axis = service.axis(command.axis)
    velocity = checked_velocity(command.velocity, axis.velocity, axis.name)
    return service.begin(
        "moving", f"moving {axis.name}",
        lambda stage: service.motions.move(
            stage, axis.name, command.position, command.distance or 0.0, velocity
        ),
    )  # fmt: skip


def jog(service: Service, command: ask.Jog, *_: object) -> Job:
    """Jog an axis, or go on with that."""
    axis = service.axis(command.axis)
    most = min(JOG_MOST, axis.velocity)
    if abs(command.velocity) > most:
        raise RefusedError("input", f"axis {axis.name}: a jog has at most {most:g} m/s")
    if service.jog is not None:
        job, jogged, demand = service.jog
        if service.job is not None and service.job.id == job.id and jogged == axis.name:
            demand.velocity, demand.renewed = command.velocity, time.monotonic()
            return job
    demand = JogDemand(command.velocity, time.monotonic())
    job = service.begin(
        "moving", f"jogging {axis.name}",
        lambda stage: service.motions.jog(stage, axis.name, demand),
    )  # fmt: skip
    service.jog = job, axis.name, demand
    return job


def measure(service: Service, command: ask.Measure, *_: object) -> Job:
    """Measure how the axes respond."""
    machine, simulated = service.setup.machine, service.setup.simulated is not None
    return service.begin(
        "moving", "measuring the axes",
        lambda stage: motions.measure(stage, machine, simulated, command.agreed),
    )  # fmt: skip


def check(service: Service, command: ask.Check, *_: object) -> Job:
    """Check a drive, by a move where that is asked for."""
    setup, handover = service.setup, service.handover
    if not command.move:
        return service.begin(
            "moving", f"checking node {command.node}",
            alone=lambda bus: motions.check_drive(
                bus, handover, command.node, command.power, command.homing
            ),
        )  # fmt: skip
    axis = next((each for each in setup.axes if each.node == command.node), None)
    if axis is None:
        raise RefusedError("unknown", f"no axis has node id {command.node}")
    return service.begin(
        "moving", f"checking axis {axis.name} by a move",
        alone=lambda bus: motions.check_move(bus, handover, axis, setup.machine),
    )  # fmt: skip


def check_recipe(service: Service, command: ask.CheckRecipe, *_: object) -> Later:
    """Check a recipe, and count what it does."""
    machine = service.setup.machine
    recipe = parse_recipe(command.recipe, command.source, machine)
    return service.later(lambda: dry_run(recipe, machine).as_dict())


def queue_add(service: Service, command: ask.QueueAdd, *_: object) -> dict[str, int]:
    """Put a recipe at the end of the queue."""
    recipe = asked_recipe(command, setup_for(service.setup, command).machine)
    if command.options.compensation == "oracle" and service.setup.simulated is None:
        raise RefusedError("input", "oracle: a real stage's friction is unknown")
    entry = service.queue.add(command, recipe.name, recipe.lot, recipe.wafer)
    service.notices.say("queue", f"{recipe.name}: in the queue", {"id": entry.id})
    if command.start:
        service.queue.runs = True
    return {"id": entry.id}


def queue_remove(service: Service, command: ask.QueueRemove, *_: object) -> dict[str, bool]:
    """Take an entry off the queue."""
    entry = service.queue.find(command.id)
    if entry is None:
        raise RefusedError("unknown", f"the queue has no entry {command.id}")
    if entry.status in ("running", "finishing"):
        raise RefusedError("busy", f"entry {command.id} is running; abort it first")
    service.queue.remove(command.id)
    return {"removed": True}


def queue_reorder(service: Service, command: ask.QueueReorder, *_: object) -> dict[str, bool]:
    """Put an entry at another place."""
    entry = service.queue.find(command.id)
    if entry is None or entry.status != "waiting":
        raise RefusedError("unknown", f"no entry {command.id} waits in the queue")
    service.queue.reorder(command.id, command.place)
    return {"moved": True}


def queue_start(service: Service, *_: object) -> dict[str, bool]:
    """Run what waits."""
    service.queue.runs = service.queue.next() is not None
    return {"runs": service.queue.runs}


def queue_halt(service: Service, *_: object) -> dict[str, bool]:
    """Begin with no further entry."""
    service.queue.runs = False
    return {"runs": False}


def pause(service: Service, *_: object) -> dict[str, bool]:
    """Pause the run."""
    service.require_run().pause.ask()
    return {"asked": True}


def resume(service: Service, *_: object) -> dict[str, bool]:
    """Go on with the run."""
    service.require_run().pause.withdraw()
    return {"asked": True}


def abort(service: Service, command: ask.Abort, request: ask.Request) -> dict[str, bool]:
    """End the run."""
    service.require_run()
    service.runner.abort(_reason(command, request))
    return {"asked": True}


def read_object(service: Service, command: ask.ReadObject, *_: object) -> Later:
    """Read an object of a drive."""
    node, ref = _object(service, command)
    return service.later(lambda: {"value": node.read_value(ref)})


def write_object(service: Service, command: ask.WriteObject, *_: object) -> Later:
    """Write an object of a drive."""
    service.require_free()
    node, ref = _object(service, command)

    def write() -> dict[str, bool]:
        node.write(ref, command.value)
        return {"written": True}

    return service.later(write)


def _object(service: Service, command: ask.ReadObject | ask.WriteObject) -> tuple[Node, ObjectRef]:
    """The node of the axis named, and the object."""
    name = service.axis(command.axis).name
    node = next(axis.node for axis in service.require_stage().axes if axis.name == name)
    return node, ObjectRef(command.index, command.subindex, "object")


def listen(service: Service, *_: object) -> dict[str, float]:
    """Publish frames for a while."""
    service.handover.listened_until = time.monotonic() + LISTENED
    return {"for": LISTENED}


def send_frame(service: Service, command: ask.SendFrame, request: ask.Request) -> dict[str, bool]:
    """Send an SDO request."""
    if command.data[0] >> 5 not in _READS:
        service.require_command(request.lease)
        service.require_free()
    service.require_stage()
    service.handover.outgoing.append((command.can_id, command.data))
    return {"sent": True}
