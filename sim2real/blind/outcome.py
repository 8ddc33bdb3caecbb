"""The outcome of a trial, and its line of JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, TypeAdapter

from sim2real.blind.draw import Drawn
from sim2real.json_numbers import Number

Figure = Annotated[Number, BeforeValidator(lambda value: math.nan if value is None else value)]
"""Null in JSON where it is not finite."""


@dataclass(frozen=True, slots=True)
class ReportedCause:
    """A cause as the diagnosis reported it.

    Attributes:
        axis, effect, probability, gap_closed: as in the report.
        parameters: key -> (value, sigma).
    """

    axis: str
    effect: str
    probability: Figure
    gap_closed: Number | None
    parameters: Mapping[str, tuple[Figure, Figure]]


@dataclass(frozen=True, slots=True)
class Outcome:
    """The outcome of a trial; plain values, to be written as a line of JSON and read back.

    Attributes:
        seed, number: which trial.
        leave_out: the true effects were not in the library.
        kind: of the key.
        truth: of the key.
        verdict: of the report.
        reported: its causes, in its order.
        confusable: its sets, (axis, names).
        unlisted: its coordinates, (axis, the likeliest and those alike), most probable first.
        sigmas: "axis.effect.key" -> (reported - true)/sigma, of causes named correctly.
        gap: combined gap in floors of the machine file against the first recording.
        promised: gap closed that the report promises, None where it promises none.
        second: gap closed by the same effects on the second run, None likewise.
        promised_by_twin, second_by_twin: the same of the twin as it is written.
        within, within_by_twin: as the second ones, where the first run has been to.
        seconds: time of the diagnosis [s].
        processor: processor time of all cores together [s].
        key, nonce, digest: of the seal.
        error: why there is no report, "" where there is one.
    """

    seed: int
    number: int
    leave_out: bool
    kind: str
    truth: tuple[Drawn, ...]
    verdict: str
    reported: Annotated[tuple[ReportedCause, ...], Field(alias="told")]
    confusable: tuple[tuple[str, tuple[str, ...]], ...]
    sigmas: Mapping[str, Figure]
    gap: Figure
    promised: Number | None
    second: Number | None
    seconds: float
    processor: Annotated[Figure, Field(default=math.nan)]
    key: str
    nonce: str
    digest: str
    error: str = ""
    unlisted: tuple[tuple[str, tuple[str, ...]], ...] = ()
    promised_by_twin: Number | None = None
    second_by_twin: Number | None = None
    within: Number | None = None
    within_by_twin: Number | None = None

    def to_json(self) -> dict[str, Any]:
        """Plain values; figures that are not finite are null."""
        values: dict[str, Any] = _ADAPTER.dump_python(self, mode="json", by_alias=True)
        return values

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> Outcome:
        """The outcome of `to_json`; unknown keys are ignored.

        Raises:
            ValueError: these are the values of none.
        """
        return _ADAPTER.validate_python(dict(values))


_ADAPTER = TypeAdapter(Outcome)
