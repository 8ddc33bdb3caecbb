"""A measurement of a stage's responses, and its file: docs/formats/response.md, version 1.

The file holds the responses, not what follows from them: gains are designed when they are needed.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator

from estimation.response import AxisResponse, FrequencyResponse
from stagectl.config.machine import Axis, Machine
from stagectl.errors import UnusableInput
from stagectl.plain_text import one_line

SUFFIX = ".response.json"
DIGITS = 6
"""Significant digits kept of each value: a measurement is known to fewer."""


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Identity(_Part):
    """Identity object (0x1018) of a drive; None for what it lacks."""

    vendor: int | None
    product: int | None
    revision: int | None
    serial: int | None

    def difference(self, now: Identity) -> str | None:
        """What is another now, in words; None where nothing is."""
        changed = [
            f"{name} {getattr(now, name)}, was {getattr(self, name)}"
            for name in Identity.model_fields
            if getattr(now, name) != getattr(self, name)
        ]
        return ", ".join(changed) or None


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredAxis:
    """One axis.

    Attributes:
        identity: of its drive; None where it was simulated.
        settings: what the response depends on, as the machine file had it: key -> value.
        response: measured.
    """

    identity: Identity | None
    settings: Mapping[str, float]
    response: AxisResponse


@dataclass(frozen=True, slots=True, eq=False)
class Measurement:
    """The responses of a stage.

    Attributes:
        measured: when, ISO 8601; None where it was simulated.
        machine: name of the stage.
        axes: those that were measured, by name.
        source: the file that it came from, for messages.
    """

    measured: str | None
    machine: str
    axes: Mapping[str, MeasuredAxis]
    source: str = "measurement"

    def as_text(self) -> str:
        """Content of its file."""
        axes = {
            name: {
                "drive": None if axis.identity is None else axis.identity.model_dump(),
                "settings": dict(axis.settings),
                "rest": _as_lists(axis.response.rest),
                "sliding": _as_lists(axis.response.sliding),
            }
            for name, axis in self.axes.items()
        }
        return json.dumps(
            {"format": "stagectl-response", "version": 1, "measured": self.measured,
             "machine": self.machine, "axes": axes}
        )  # fmt: skip

    def objection(self, machine: Machine, name: str, simulated: bool = False) -> str | None:
        """Why the measurement says nothing of an axis of a machine file; None where it does.

        Args:
            machine: as its file has it now.
            name: of the axis.
            simulated: what has changed since does not matter.
        """
        measured = self.axes.get(name)
        if measured is None:
            return f"not in {self.source}"
        if simulated:
            return None
        if self.measured is None:
            return "that measurement is of a virtual stage"
        if self.machine != machine.name:
            return f"{self.source} is of {self.machine}, not of {machine.name}"
        for key, now in settings_of(machine.axes[name], machine.bus.sync_period).items():
            then = measured.settings.get(key)
            if then is None or abs(then - now) > 1e-9 * abs(now):
                before = "without it" if then is None else f"with {then:g}"
                return f"{key} is {now:g}; it was measured {before}"
        return None


def settings_of(axis: Axis, period: float) -> dict[str, float]:
    """What the response of an axis depends on besides the stage itself."""
    drive = axis.drive
    gains = {} if drive.pid is None else drive.pid.model_dump()
    return {
        "bus.sync_period": period,
        **{f"drive.pid.{name}": float(value) for name, value in gains.items()},
        "drive.rated_force": drive.rated_force,
        "drive.position_unit": drive.position_unit,
    }


def response_path(machine: Machine, path: Path | None) -> Path:
    """Where the measurement of a machine file belongs: beside it, or here for the packaged one.

    Args:
        machine: of the file.
        path: of the file; None for the packaged one.
    """
    return Path(f"{machine.name}{SUFFIX}") if path is None else path.with_suffix(SUFFIX)


def load_measurement(path: Path) -> Measurement:
    """Read a file.

    Raises:
        UnusableInput: naming the file, the key and the reason.
    """
    try:
        text = path.read_text()
    except OSError as error:
        raise UnusableInput(f"{path}: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise UnusableInput(f"{path}: is no measurement: not text") from error
    return parse_measurement(text, str(path))


def parse_measurement(text: str, source: str) -> Measurement:
    """Read a file's content.

    Args:
        text: the content.
        source: the file's name, for messages.

    Raises:
        UnusableInput: naming the file, the key and the reason.
    """
    try:
        file = _File.model_validate_json(text)
        axes = {name: axis.measured() for name, axis in file.axes.items()}
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = (source, ".".join(map(str, first["loc"])), one_line(first["msg"]))
        raise UnusableInput(": ".join(filter(None, where))) from None
    except ValueError as error:
        raise UnusableInput(f"{source}: axes: {error}") from error
    return Measurement(file.measured, file.machine, axes, source)


class _Response(_Part):
    at: tuple[float, ...] = Field(min_length=2, max_length=100_000)
    real: tuple[float, ...]
    imaginary: tuple[float, ...]
    sigma: tuple[float, ...]

    def arrays(self, what: str) -> list[Any]:
        at, real, imaginary, sigma = (
            np.array(v, np.float64) for v in (self.at, self.real, self.imaginary, self.sigma)
        )
        if not len(at) == len(real) == len(imaginary) == len(sigma):
            raise ValueError(f"{what}: at, real, imaginary and sigma differ in length")
        if not (at[0] > 0.0 and (np.diff(at) > 0.0).all()):
            raise ValueError(f"{what}: frequencies do not increase from above 0")
        value = real + 1j * imaginary
        if not (value != 0.0).all() or (sigma < 0.0).any():
            raise ValueError(f"{what}: a response of 0, or a sigma below 0")
        return [at, value, sigma]


class _State(_Part):
    offset: _Response
    demand: _Response
    distortion: float = Field(ge=0.0)

    def response(self, what: str) -> FrequencyResponse:
        at, offset, sigma = self.offset.arrays(f"{what}.offset")
        demand_at, demand, demand_sigma = self.demand.arrays(f"{what}.demand")
        return FrequencyResponse(
            at, demand_at, offset, demand, sigma, demand_sigma, self.distortion
        )


class _Axis(_Part):
    drive: Identity | None
    settings: Mapping[str, float]
    rest: _State
    sliding: _State

    def measured(self) -> MeasuredAxis:
        response = AxisResponse(self.rest.response("rest"), self.sliding.response("sliding"))
        if not np.array_equal(response.rest.offset_at, response.sliding.offset_at):
            raise ValueError("the frequencies at rest and while sliding differ")
        return MeasuredAxis(self.drive, self.settings, response)


class _File(_Part):
    format: Literal["stagectl-response"]
    version: Literal[1]
    measured: str | None
    machine: str
    axes: Mapping[str, _Axis] = Field(min_length=1, max_length=8)

    @field_validator("measured")
    @classmethod
    def _with_zone(cls, moment: str | None) -> str | None:
        """When an observer that was taken out counts from: both have to be comparable."""
        if moment is not None and datetime.fromisoformat(moment).tzinfo is None:
            raise ValueError("has no time zone")
        return moment


def _as_lists(response: FrequencyResponse) -> dict[str, Any]:
    return {
        "offset": _one(response.offset_at, response.offset, response.offset_sigma),
        "demand": _one(response.demand_at, response.demand, response.demand_sigma),
        "distortion": float(f"{response.distortion:.{DIGITS}g}"),
    }


def _one(at: Any, value: Any, sigma: Any) -> dict[str, list[float]]:
    columns = {"at": at, "real": value.real, "imaginary": value.imag, "sigma": sigma}
    return {
        name: [float(f"{v:.{DIGITS}g}") for v in column.tolist()]
        for name, column in columns.items()
    }
