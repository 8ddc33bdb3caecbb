"""The outcome of a trial, and its line of JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from sim2real.blind.draw import Drawn


@dataclass(frozen=True, slots=True)
class ReportedCause:
    """A cause as the diagnosis reported it.

    Attributes:
        axis, effect, probability, gap_closed: as in the report.
        parameters: key -> (value, sigma).
    """

    axis: str
    effect: str
    probability: float
    gap_closed: float | None
    parameters: Mapping[str, tuple[float, float]]


_KEYS = {"reported": "told"}
"""Fields whose key in the JSON differs from their name."""


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
        sigmas: "axis.effect.key" -> (reported - true)/sigma, of causes named correctly.
        gap: combined gap in floors of the machine file against the first recording.
        promised: gap closed that the report promises, None where it promises none.
        second: gap closed by the same twin on the second run, None likewise.
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
    reported: tuple[ReportedCause, ...]
    confusable: tuple[tuple[str, tuple[str, ...]], ...]
    sigmas: Mapping[str, float]
    gap: float
    promised: float | None
    second: float | None
    seconds: float
    processor: float
    key: str
    nonce: str
    digest: str
    error: str = ""

    def to_json(self) -> dict[str, Any]:
        """Plain values; figures that are not finite are null."""
        plain: dict[str, Any] = _plain(asdict(self))
        return {_KEYS.get(name, name): value for name, value in plain.items()}

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> Outcome:
        """The outcome of `to_json`; unknown keys are ignored."""
        names = {_KEYS.get(name, name): name for name in cls.__dataclass_fields__}
        known = {name: values[key] for key, name in names.items() if key in values}
        known["truth"] = tuple(Drawn(**drawn) for drawn in values["truth"])
        known["reported"] = tuple(
            ReportedCause(
                **{
                    **cause,
                    "parameters": {
                        key: (_number(value), _number(sigma))
                        for key, (value, sigma) in cause["parameters"].items()
                    },
                }
            )
            for cause in values["told"]
        )
        known["processor"] = _number(values.get("processor"))
        known["confusable"] = tuple((axis, tuple(names)) for axis, names in values["confusable"])
        known["sigmas"] = {key: _number(value) for key, value in values["sigmas"].items()}
        return cls(**known)


def _number(value: float | None) -> float:
    return math.nan if value is None else value


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _plain(inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(inner) for inner in value]
    if isinstance(value, (float, np.floating)):
        return float(value) if math.isfinite(value) else None
    return value
