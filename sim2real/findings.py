"""What a diagnosis of the gap finds, and its JSON (docs/formats/gap-report.md).

Plain values in SI units; nothing here computes. The JSON of a finding has its fields in
their order: unknown figures are null where the format says so and left out elsewhere.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Annotated, Any

from pydantic import Field, TypeAdapter, WrapSerializer

from sim2real.empirical_force import EmpiricalForce
from sim2real.json_numbers import Number, NumberIfAny

FORMAT, VERSION = "stagectl-gap-report", 2

NO_GAP = "no_gap"
EXPLAINED = "explained"
PARTLY_EXPLAINED = "partly_explained"
UNEXPLAINED = "unexplained"
INSUFFICIENT = "insufficient"
SHORTEST = 1.0
"""Recordings shorter than this are insufficient [s]."""
VERDICTS = (NO_GAP, EXPLAINED, PARTLY_EXPLAINED, UNEXPLAINED, INSUFFICIENT)

OVER = {
    "velocity": "m/s",
    "position": "m",
    "position_direction": "m",
    "reversal_path": "m",
    "force": "N",
    "acceleration": "m/s^2",
    "time": "s",
    "frequency": "Hz",
    "other_axis": "m",
}
"""Coordinates of unlisted effects, and their units."""

CLOSED_LOOP, OPEN_LOOP = "closed_loop", "open_loop"
"""What is simulated: the loop from its demands, or the force along the measured motion."""

SIGNALS = {"position": "m", "force": "N"}
"""Signals of an axis that are compared, and their units."""
SHOWN_AS = {"m": (1e6, "µm"), "rad": (1e6, "µrad"), "N": (1.0, "N"), "N m": (1.0, "N m")}
"""Units of gaps -> factor and unit in which people read them."""

Json = dict[str, Any]

Words = Annotated[str, Field(exclude=True)]
"""For people; not part of the JSON."""
GIVEN = Field(exclude_if=lambda value: value is None or value == "")
"""Part of the JSON only where there is a value."""


@dataclass(frozen=True, slots=True)
class ChannelFinding:
    """One fault of a channel, found before any physics is considered.

    Attributes:
        axis: its name.
        channel: dataset of the recording format it concerns ("force_actual", "time", ...).
        finding: "units", "sign", "scale", "offset", "delay", "clock", "jitter", "quantisation",
            "saturation", "controller", ...
        value: its size, None where it has none.
        unit: of the value.
        applied: True where the recording was corrected for it before the diagnosis.
        text: one sentence for people; not part of the JSON.
    """

    axis: str
    channel: str
    finding: str
    value: Number | None
    unit: str
    applied: bool = False
    text: Words = ""


@dataclass(frozen=True, slots=True)
class GapFigures:
    """Gap of one signal of one axis, in `unit`.

    Attributes:
        nominal: rms of recorded minus simulated by the machine file as given.
        floor: what even a perfect model would leave.
        unit: "m" or "N"; of an axis that turns "rad" or "N m".
        explained: rms with the causes included, None where nothing was fitted.
    """

    nominal: Number
    floor: Number
    explained: Annotated[Number | None, GIVEN] = field(default=None, kw_only=True)
    unit: str


Gap = Mapping[str, Mapping[str, GapFigures]]
"""Axis -> signal ("position", "force") -> figures."""


@dataclass(frozen=True, slots=True)
class Where:
    """One cell of the recordings that holds much of the gap.

    Attributes:
        axis: its name.
        signal: "position" or "force".
        by: what the cell is cut by: "axis", "phase", "position", "velocity", "direction", "time",
            "frequency" (in Hz, or in 1/m over position) or "move".
        share: of the gap's energy above the floor over all axes and signals, 0..1.
        range: (low, high) for position, velocity, time and frequencies; else None.
        value: of a phase, a direction (-1, 1) or a move (number from 0); else None.
        unit: of the range; "" where there is none.
        text: one sentence for people; not part of the JSON.
    """

    axis: str
    signal: str
    by: str
    range: Annotated[tuple[Number, Number] | None, GIVEN] = field(default=None, kw_only=True)
    unit: Annotated[str, GIVEN] = field(default="", kw_only=True)
    value: Annotated[str | int | None, GIVEN] = field(default=None, kw_only=True)
    share: Number
    text: Words = ""


@dataclass(frozen=True, slots=True)
class Parameter:
    """A fitted parameter of an effect with its standard deviation."""

    value: Number
    sigma: Number
    unit: str


@dataclass(frozen=True, slots=True)
class Cause:
    """An effect that the recordings show to be present.

    Attributes:
        axis: on which it acts.
        effect: name as in effects.md.
        probability: that it is present on that axis.
        parameters: key as in effects.md -> figure.
        gap_closed: share of the gap that reopens when it is removed from the final model; None
            where the gap is too small to say.
        gap_closed_interval: 95 % interval of it.
        remedy: one sentence on what is usually done about it; not part of the JSON.
    """

    axis: str
    effect: str
    probability: Number
    parameters: Mapping[str, Parameter]
    gap_closed: Number | None
    gap_closed_interval: tuple[Number, Number] | None
    remedy: Words = ""


@dataclass(frozen=True, slots=True)
class ForceCurve:
    """A force over a coordinate, linear between nodes, or the error of a reading.

    Attributes:
        at: nodes, in the coordinate's unit.
        force: at each of them [N]; of a reading [m].
        sigma: of these.
    """

    at: tuple[Number, ...]
    force: tuple[Number, ...]
    sigma: tuple[Number, ...]


@dataclass(frozen=True, slots=True)
class Unlisted:
    """A coordinate that a force depends on which no effect of the library has.

    Attributes:
        axis: on which it acts.
        over: the coordinate: one of `OVER`.
        alike: coordinates that these recordings cannot tell from it.
        probability: that it is the right one.
        gap_closed: share of the axis' gap in force along the motion that the curve closes on
            held-out moves; beside causes, of what these leave; see `seen_in`.
        gap_closed_interval: 95 % interval of it.
        curve: the force. Over position_direction that of forward motion, over reversal_path after a
            full reversal, over frequency amplitudes of oscillators driven by the acceleration. Of a
            misreading, what the encoder reads too much [m].
        times: "force" where the curve is multiplied by the motor force over its rms, "friction"
            where it changes sign with the direction, "history" where it depends on where the
            coordinate last turned, "reading" where an encoder that misreads looks like a force; ""
            for neither, or where `over` says it.
        seen_in: "innovations" where friction's wander hides it along the motion: `gap_closed` is
            then the share of the one-step prediction errors beyond noise; else "".
        period: distance after which a force over position repeats itself [m]; 0 where none shows.
    """

    axis: str
    over: str
    alike: tuple[str, ...]
    probability: Number
    gap_closed: Number
    gap_closed_interval: tuple[Number, Number]
    curve: ForceCurve
    times: Annotated[str, GIVEN] = ""
    seen_in: Annotated[str, GIVEN] = ""
    period: NumberIfAny = 0.0

    @property
    def what(self) -> str:
        """What depends on the coordinate, in words."""
        return "an error of the encoder" if self.times == "reading" else "a force"


@dataclass(frozen=True, slots=True)
class Candidate:
    """An effect that was considered, whether or not it was taken as a cause, as reported.

    Attributes:
        axis, effect, probability: as of a cause.
        gap_closed: share that it closes alone, on the moves it was fitted to; for a cause the share
            that reopens when it is removed, on held-out moves; None where it was not fitted.
    """

    axis: str
    effect: str
    probability: Number
    gap_closed: Number | None


@dataclass(frozen=True, slots=True)
class Confusable:
    """Effects that these recordings cannot tell apart.

    Attributes:
        axis: on which they would act.
        effects: their names, the most probable first.
        why: one sentence.
    """

    axis: str
    effects: tuple[str, ...]
    why: str


@dataclass(frozen=True, slots=True)
class SelectionStep:
    """One step of a search that adds one effect after another to an axis.

    Attributes:
        axis: on which.
        added: effects that the step added, mostly one.
        effects: all of them from then on.
        gap_closed: share of the axis' gap that they close on held-out moves.
        sigma: of what the step added to it, one standard deviation over moves.
        elsewhere: share that they close on recordings that took no part in the diagnosis, with the
            same figures; None where there are none.
    """

    axis: str
    added: tuple[str, ...]
    effects: tuple[str, ...]
    gap_closed: Number
    sigma: Number
    elsewhere: Annotated[Number | None, GIVEN] = None


@dataclass(frozen=True, slots=True)
class NextExperiment:
    """The moves to record next.

    Attributes:
        why: one sentence.
        moves: as under `moves` of a recipe.
        macro, micro: velocity, acceleration and jerk of these moves (SI), as in a recipe.
    """

    why: str
    moves: tuple[Mapping[str, Any], ...]
    macro: Annotated[Mapping[str, float], Field(exclude=True)]
    micro: Annotated[Mapping[str, float], Field(exclude=True)]

    def recipe(self, name: str = "next-experiment") -> dict[str, Any]:
        """A recipe for `stagectl run`."""
        return {
            "recipe": name,
            "macro": dict(self.macro),
            "micro": dict(self.micro),
            "settle": {"window": 1e-6, "hold": 0.005, "timeout": 0.5},
            "moves": self._moves(),
        }

    def _moves(self) -> list[Json]:
        """Separate copies: YAML would write shared lists as aliases."""
        return [
            {key: list(value) if isinstance(value, list) else value for key, value in move.items()}
            for move in self.moves
        ]


@dataclass(frozen=True, slots=True)
class FittedFigure:
    """A figure that the machine file leaves unknown, as the recordings have it.

    Attributes:
        axis: its name.
        figure: key in the machine file.
        value, sigma: of the figure.
        unit: of both.
    """

    axis: str
    figure: str
    value: Number
    sigma: Number
    unit: str


@dataclass(frozen=True, slots=True)
class FigureChange:
    """A plant figure of the machine file that the fit changes within its tolerance.

    Attributes:
        axis: its name.
        figure: key in the machine file.
        old: the machine file's value.
        new: as fitted.
        sigma: of `new`.
        unit: of all three.
        written: whether the twin has `new`; else it keeps `old`, and this is a warning.
        why: one clause.
    """

    axis: str
    figure: str
    old: Number
    new: Number
    sigma: Number
    unit: str
    written: bool
    why: str

    def texts(self) -> tuple[str, str, str]:
        """`old`, `new` and `sigma` for people, to two digits of sigma."""
        decimals = max(1 - math.floor(math.log10(self.sigma)), 0)
        old, new, sigma = (f"{v:.{decimals}f}" for v in (self.old, self.new, self.sigma))
        return old, new, sigma


@dataclass(frozen=True, slots=True)
class GapReport:
    """The whole diagnosis.

    Attributes:
        recordings: by name.
        verdict: one of `VERDICTS`.
        reason: one sentence.
        channels: faults of channels.
        where: cells of motion that hold most of the gap, largest share first.
        causes: effects found, largest share of the gap first.
        unlisted: coordinates of forces that no effect of the library has, most probable first.
        candidates: effects considered.
        confusable: sets of effects that the recordings cannot tell apart.
        gap: axis -> signal -> figures.
        gap_closed: on held-out moves; None where the gap is too small (G0^2 < 1.5 floor^2) or
            nothing was fitted.
        gap_closed_interval: 95 % interval of it, by bootstrap over moves.
        gap_closed_in_sample: on the moves that were fitted.
        gap_closed_by_twin: on held-out moves by the twin as it is written, with what `empirical`
            describes; `gap_closed` is that of the causes alone.
        gap_closed_by_twin_interval: 95 % interval of it.
        gap_closed_elsewhere: on recordings that took no part in the diagnosis; None where there are
            none.
        steps: of axes where effects were added one after another.
        mode: `CLOSED_LOOP`, or `OPEN_LOOP` where forces are compared along the measured motion.
        clock: sentence on the time from which fading effects count; None for a single recording.
        fitted: figures that the machine file leaves unknown.
        figures: figures of the machine file that a twin changes, and those whose fit ends at its
            bound; empty without causes.
        empirical: descriptions of what no effect explains; empty where it is explained.
        next_experiment: None where nothing is left to distinguish.

    Raises:
        ValueError: an unknown verdict.
    """

    recordings: tuple[str, ...]
    verdict: str
    reason: str
    mode: str = field(default=CLOSED_LOOP, kw_only=True)
    clock: str | None = field(default=None, kw_only=True)
    fitted: tuple[FittedFigure, ...] = field(default=(), kw_only=True)
    figures: tuple[FigureChange, ...] = field(default=(), kw_only=True)
    empirical: tuple[EmpiricalForce, ...] = field(default=(), kw_only=True)
    channels: tuple[ChannelFinding, ...] = ()
    gap: Annotated[Gap | None, WrapSerializer(lambda gap, serialize: serialize(gap or {}))] = None
    gap_closed: Number | None = None
    gap_closed_interval: tuple[Number, Number] | None = None
    gap_closed_in_sample: Number | None = None
    gap_closed_by_twin: Number | None = None
    gap_closed_by_twin_interval: tuple[Number, Number] | None = None
    gap_closed_elsewhere: Number | None = None
    where: tuple[Where, ...] = ()
    causes: tuple[Cause, ...] = ()
    unlisted: tuple[Unlisted, ...] = ()
    candidates: tuple[Candidate, ...] = ()
    confusable: tuple[Confusable, ...] = ()
    steps: tuple[SelectionStep, ...] = ()
    next_experiment: NextExperiment | None = None

    def __post_init__(self) -> None:
        if self.verdict not in VERDICTS:
            raise ValueError(f"verdict: {self.verdict!r} is none of {', '.join(VERDICTS)}")

    def to_json(self) -> Json:
        """The report in the layout of docs/formats/gap-report.md, ready for `json.dumps`."""
        return {"format": FORMAT, "version": VERSION, **finding_json(self)}


def finding_json(finding: Hashable) -> Json:
    """A finding as JSON values, by the schema of its class."""
    values: Json = _adapter(type(finding)).dump_python(finding, mode="json")
    return values


def gap_json(gap: Gap) -> Json:
    """The value of `gap`."""
    return {
        axis: {signal: finding_json(figures) for signal, figures in signals.items()}
        for axis, signals in gap.items()
    }


def schema() -> Json:
    """The JSON schema of a report."""
    made = _adapter(GapReport).json_schema(mode="serialization")
    head = {"format": {"const": FORMAT}, "version": {"const": VERSION}}
    return {**made, "properties": {**head, **made["properties"]}}


@cache
def _adapter(of: type) -> TypeAdapter[Any]:
    return TypeAdapter(of)
