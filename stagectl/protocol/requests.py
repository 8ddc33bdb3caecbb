"""What a client can ask a stage server for: one model per operation.

Operations that take time (home, move, ...) are answered with a job; `wait` is answered when it has
ended.
"""

from __future__ import annotations

from typing import Annotated, Literal

from annotated_types import Gt, Le
from pydantic import Field, model_validator

from stagectl.protocol.message import Finite, Index, Message, Name, Text

MOST_RECIPE = 1_000_000
"""Characters of a recipe, or of a machine file."""


class Info(Message):
    """Who serves: program, machine, bus, axes with their limits. Answer: `state.ServerInfo`."""

    op: Literal["info"] = "info"


class GetState(Message):
    """The present state. Answer: `state.State`."""

    op: Literal["state"] = "state"


class GetEvents(Message):
    """Events numbered above `since`, at most the last 1000. Answer: list of `state.Notice`."""

    op: Literal["events"] = "events"
    since: Index = 0


class Take(Message):
    """Take command of the stage, so that other clients only watch; `force` takes it from another.

    Answer: `{"lease": token}`, to be sent with every request; kept alive by any of them.
    """

    op: Literal["take"] = "take"
    force: bool = False


class Release(Message):
    """Give command back."""

    op: Literal["release"] = "release"


class Enable(Message):
    """Enable all axes and hold them where they are. Answer: a job."""

    op: Literal["enable"] = "enable"
    reset: bool = False


class Disable(Message):
    """Switch the power of all axes off. Answer: a job."""

    op: Literal["disable"] = "disable"


class Home(Message):
    """Home all axes not homed yet, with `force` all; they are held afterwards. Answer: a job."""

    op: Literal["home"] = "home"
    force: bool = False
    reset: bool = False


class Move(Message):
    """Move an axis by the drive's own profile, to `position` or by `distance` [m]; a job."""

    op: Literal["move"] = "move"
    axis: Name
    position: Finite | None = None
    distance: Finite | None = None
    velocity: Annotated[Finite, Gt(0)] | None = None

    @model_validator(mode="after")
    def _one_target(self) -> Move:
        if (self.position is None) == (self.distance is None):
            raise ValueError("needs either position or distance")
        return self


class Jog(Message):
    """Move an axis at `velocity` [m/s] for as long as this is sent again within 0.2 s.

    Velocity 0 brakes at once. Answer: the job, the same for all renewals.
    """

    op: Literal["jog"] = "jog"
    axis: Name
    velocity: Finite


class Measure(Message):
    """Home the stage and measure how its axes respond: they shake and slide. Answer: a job.

    Its result is `{"does": lines}`, what each axis will do, unless `agreed`; then
    `{"measurement": text of a response file}`.
    """

    op: Literal["measure"] = "measure"
    agreed: bool = False


class Check(Message):
    """Test a drive as `stagectl check` does, with `move` by a move of 0.1 mm. Answer: a job.

    All axes lose their power, and all drives are booted again afterwards. Its result is
    `{"found": list of findings}`.
    """

    op: Literal["check"] = "check"
    node: Annotated[int, Field(ge=1, le=126)]
    power: bool = True
    homing: bool = False
    move: bool = False


class Stop(Message):
    """Quick-stop all axes and switch their power off, whatever is under way, whoever commands."""

    op: Literal["stop"] = "stop"
    reason: Text = ""


class Wait(Message):
    """Wait until a job has ended, at most `timeout` [s]. Answer: `state.Job`."""

    op: Literal["wait"] = "wait"
    job: Index
    timeout: Annotated[Finite, Gt(0), Le(3600)] = 10.0


class RunOptions(Message):
    """How a recipe is run; as the options of `stagectl run`."""

    compensation: Literal["none", "model", "estimated", "oracle"] = "estimated"
    friction_scale: Annotated[Finite, Gt(0), Le(100)] = 1.0
    observer: bool = True
    use_map: bool = True
    retries: Annotated[int, Field(ge=0, le=100)] = 0
    history: Text | None = None


class MachineFile(Message):
    """A machine file: its text, and its path for messages and for files that it names."""

    text: Annotated[str, Field(max_length=MOST_RECIPE)]
    source: Text


class QueueAdd(Message):
    """Put a recipe at the end of the queue, checked first. Answer: `{"id": number}`.

    Attributes:
        recipe: its text.
        source: its file name, for messages; a plug-in path in it counts from there.
        folder: for its files; None: RECIPE-TIME in the server's data folder.
        resume: folder of the interrupted run to continue.
        places: `recipe` is a calibration file, and friction is measured at these places [m].
        machine: what the run believes of the stage in place of the server's machine file, such as
            a twin; bus and drives are the same.
        start: begin with the queue at once, if it is not stopped by an earlier failure.
    """

    op: Literal["queue_add"] = "queue_add"
    recipe: Annotated[str, Field(max_length=MOST_RECIPE)]
    source: Text
    folder: Text | None = None
    operator: Name | None = None
    comment: Text | None = None
    resume: Text | None = None
    places: Annotated[tuple[tuple[Finite, Finite], ...], Field(max_length=10_000)] | None = None
    options: RunOptions = RunOptions()
    machine: MachineFile | None = None
    start: bool = False


class QueueRemove(Message):
    """Take an entry that waits or has ended off the queue."""

    op: Literal["queue_remove"] = "queue_remove"
    id: Index


class QueueReorder(Message):
    """Put an entry that waits at another place among those that wait (0: next)."""

    op: Literal["queue_reorder"] = "queue_reorder"
    id: Index
    place: Index


class QueueStart(Message):
    """Run what waits, one after the other."""

    op: Literal["queue_start"] = "queue_start"


class QueueHalt(Message):
    """Begin with no further entry; the run under way goes on."""

    op: Literal["queue_halt"] = "queue_halt"


class Pause(Message):
    """Pause the run after the site (or entry of a list of moves) under way; axes stay held."""

    op: Literal["pause"] = "pause"


class Resume(Message):
    """Go on with a paused run."""

    op: Literal["resume"] = "resume"


class Abort(Message):
    """End the run under way by a controlled stop; axes stay held, and the queue halts."""

    op: Literal["abort"] = "abort"
    reason: Text = ""


class CheckRecipe(Message):
    """Check a recipe without running it. Answer: its plan, as of `run --dry-run --json`."""

    op: Literal["check_recipe"] = "check_recipe"
    recipe: Annotated[str, Field(max_length=MOST_RECIPE)]
    source: Text


class ReadObject(Message):
    """Read an object of an axis' drive by SDO. Answer: `{"value": ...}`."""

    op: Literal["read_object"] = "read_object"
    axis: Name
    index: Annotated[int, Field(ge=0, le=0xFFFF)]
    subindex: Annotated[int, Field(ge=0, le=0xFF)] = 0


class WriteObject(Message):
    """Write an object of an axis' drive by SDO, while nothing moves."""

    op: Literal["write_object"] = "write_object"
    axis: Name
    index: Annotated[int, Field(ge=0, le=0xFFFF)]
    subindex: Annotated[int, Field(ge=0, le=0xFF)] = 0
    value: (
        int
        | Finite
        | Annotated[str, Field(max_length=4096)]
        | Annotated[bytes, Field(max_length=4096)]
    )


class Listen(Message):
    """Have all frames of the bus published (`frames`) for 10 s from now."""

    op: Literal["listen"] = "listen"


class SendFrame(Message):
    """Send an SDO request (CAN-ID 0x601..0x67F) to a node; while anything moves, only a read."""

    op: Literal["send_frame"] = "send_frame"
    can_id: Annotated[int, Field(ge=0x601, le=0x67F)]
    data: Annotated[bytes, Field(min_length=8, max_length=8)]


class Acknowledge(Message):
    """Acknowledge an alarm: it stays in the history, and is shown no longer."""

    op: Literal["acknowledge"] = "acknowledge"
    alarm: Index


Command = Annotated[
    Info | GetState | GetEvents | Take | Release | Enable | Disable | Home | Move | Jog | Stop
    | Measure | Check | Wait | QueueAdd | QueueRemove | QueueReorder | QueueStart | QueueHalt
    | Pause | Resume | Abort | CheckRecipe | ReadObject | WriteObject | Listen | SendFrame
    | Acknowledge,
    Field(discriminator="op"),
]  # fmt: skip

FREE = (
    Info, GetState, GetEvents, Take, Release, Stop, Wait, CheckRecipe, ReadObject, Listen, SendFrame
)  # fmt: skip
"""What a client may ask for while another one commands; of `SendFrame` only reads."""


class Request(Message):
    """One request.

    Attributes:
        version: of this protocol.
        id: chosen by the client; the answer has the same.
        client: who asks, as shown to others.
        lease: token of `take`, where the client commands.
        command: what is asked for.
    """

    version: Literal[1]
    id: Index
    client: Name
    lease: Text | None = None
    command: Command
