"""What a stage server publishes and answers: its state, notices, jobs, queue, alarms."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from stagectl.protocol.message import Message

Doing = Literal[
    "starting", "off", "disabled", "booting", "homing", "enabling", "held", "moving", "running",
    "paused", "stopping", "fault",
]  # fmt: skip


class AxisInfo(Message):
    """An axis with its limits: name, travel [m], velocity [m/s], acceleration [m/s^2]."""

    name: str
    node: int
    travel: tuple[float, float]
    velocity: float
    acceleration: float


class ServerInfo(Message):
    """Who serves.

    Attributes:
        program: version of stagectl.
        machine: name of the stage.
        machine_file: its path, or "wafer-xy" for the packaged one.
        machine_digest: SHA-256 of its text, hexadecimal.
        bus: as `--bus` has it.
        simulated: on virtual drives.
        period: of SYNC [s].
        control_period: of the drives' position loops [s].
        hold_limit: how long axes stay held while nothing is asked for [s].
        pause_limit: how long a run may be paused [s].
        data: folder of runs and queue.
    """

    version: int
    program: str
    machine: str
    machine_file: str
    machine_digest: str
    bus: str
    simulated: bool
    pid: int
    started: str
    period: float
    control_period: float
    hold_limit: float
    pause_limit: float
    data: str
    axes: tuple[AxisInfo, ...]


class AxisState(Message):
    """An axis, as last sampled.

    Attributes:
        position, demand: [m]; None before the first sample.
        error: following error: demand that the drive had when it was sampled minus position [m].
        force, offset: measured force, force offset [N].
        status: power state in words.
        statusword: 0x6041.
        homed: whether position 0 is the stage's zero.
        sto: safe torque off is active, or the enable input open (0x60FD bit 3); None where the
            drive does not report it.
        brake: the holding brake is set (0x60FE:01 bit 0); None where the drive reports none.
    """

    name: str
    position: float | None
    demand: float | None
    error: float | None
    force: float | None
    offset: float | None
    status: str
    statusword: int | None
    homed: bool
    sto: bool | None = None
    brake: bool | None = None


class RunLimits(Message):
    """Limits of a recipe.

    Attributes:
        settling, peak_error: longest time [s] and largest error [m] at a site; None: no limit.
        window: that axes settle to [m].
        hold: how long they have to stay in it [s]: the last part of what `settled` reports.
    """

    settling: float | None
    peak_error: float | None
    window: float
    hold: float


class RunState(Message):
    """The run under way.

    Attributes:
        entry: its id in the queue.
        recipe, folder: name and folder.
        phase: what happens now, in words.
        sites: positions of the recipe's sites [m]; empty for a list of moves.
        site: the present one, from 1, or None.
        done, of: completed sites or entries, and how many there are.
        moves, moves_of: begun moves, and how many the plan has.
        elapsed, left: time since its first move and estimated until its end [s]; None if unknown.
        paused_since: [s since 1970], or None.
        limits: of the recipe; None while it is prepared.
    """

    entry: int
    recipe: str
    folder: str
    phase: str
    sites: tuple[tuple[float, float], ...]
    site: int | None
    done: int
    of: int
    moves: int
    moves_of: int
    elapsed: float | None
    left: float | None
    paused_since: float | None
    limits: RunLimits | None = None


class QueueEntry(Message):
    """A recipe in the queue.

    Attributes:
        status: `waiting`, `running`, `finishing` (files are made), `done`, or `interrupted` (the
            server ended meanwhile).
        machine: path of the machine file that it believes, where that is not the server's.
        outcome: of its run: completed, aborted, fault; None before its end.
        reason: why it ended early, or None.
        verdict: on the wafer, where the recipe has limits.
    """

    id: int
    recipe: str
    source: str
    lot: str | None
    wafer: str | None
    operator: str | None
    comment: str | None
    status: Literal["waiting", "running", "finishing", "done", "interrupted"]
    folder: str | None
    outcome: str | None = None
    reason: str | None = None
    verdict: str | None = None
    machine: str | None = None
    added: float


class Lease(Message):
    """Who commands, since when [s since 1970]."""

    holder: str
    since: float


class Alarm(Message):
    """A fault of the stage.

    Attributes:
        time: [s since 1970].
        axis: its name, or None where the bus or the whole stage is concerned.
        text: what happened.
        advice: what to do.
        acknowledged_by: client, or None.
    """

    id: int
    time: float
    axis: str | None
    text: str
    advice: str
    acknowledged_by: str | None = None


class Job(Message):
    """Something asked for that takes time.

    Attributes:
        error: why it failed, or None.
        kind: of the failure: "fault", "stopped", "refused" or "internal"; None without one.
        result: what it found, if anything.
    """

    id: int
    what: str
    ended: bool
    error: str | None = None
    kind: str | None = None
    result: dict[str, Any] | None = None


class State(Message):
    """The stage as it is now; published at 10 Hz and at each change.

    Attributes:
        time: [s since 1970].
        doing: in a word; `what`: in a line.
        hold_left: until held axes are disabled [s]; None where they are not held idle.
        late, missed: SYNCs that left late and samples missed since the server began.
        bus_load: share of the bus' time that all frames take at its bit rate, with the most bit
            stuffing that is possible; None before the first second.
        queue_runs: whether the next entry begins by itself.
        event: number of the last event.
    """

    version: int
    time: float
    doing: Doing
    what: str
    axes: tuple[AxisState, ...]
    enabled: bool
    homed: bool
    hold_left: float | None
    run: RunState | None
    job: Job | None
    queue: tuple[QueueEntry, ...]
    queue_runs: bool
    lease: Lease | None
    alarms: tuple[Alarm, ...]
    late: int
    missed: int
    bus_load: float | None = None
    event: int


class Notice(Message):
    """Something that happened, numbered from 1.

    Attributes:
        time: [s since 1970].
        kind: `phase`, `limitation`, `alarm`, `job`, `queue`, `lease`, `end` of a run, or an event
            of a run: `move_started`, `waiting`, `settled`, `friction`, `mark_found`,
            `mark_not_found`, `exposed`, `segment_done`, `retrying`, `stepped`, `observer`,
            `stopping`, `paused`, `resumed`.
        text: in words.
        data: its figures [SI].
    """

    number: int
    time: float
    kind: str
    text: str
    data: dict[str, Any] = Field(default_factory=dict)


class Refusal(Message):
    """Why a request was refused.

    Attributes:
        kind: `invalid` (not understood), `input` (a recipe or file is unusable), `busy`,
            `not_in_command`, `unknown` (no such job, entry, axis), `unavailable`, `internal`.
        text: one line; problems of a file in `problems`, one line each.
    """

    kind: Literal[
        "invalid", "input", "busy", "not_in_command", "unknown", "unavailable", "internal"
    ]
    text: str
    problems: tuple[str, ...] = ()


class Answer(Message):
    """The answer to a request of this id: a result, or why it was refused."""

    version: int
    id: int
    result: Any = None
    refusal: Refusal | None = None
