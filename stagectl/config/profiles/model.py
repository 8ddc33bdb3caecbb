"""The model of a drive profile. A fact that is missing is not known; nothing has a default.

Units are in the notation of CiA 303-2 (0x60A8 to 0x60AA), whether the drive states them or not.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Generic, Literal, TypeVar

from pydantic import BeforeValidator, Field, StringConstraints

from stagectl.config.machine.drive import ModeName
from stagectl.config.parsing.validation import Section, refusal

T = TypeVar("T")

Text = Annotated[str, StringConstraints(min_length=1, max_length=200)]
Family = Annotated[str, StringConstraints(pattern=r"^[a-z][a-z0-9-]{0,31}$")]
_MOST = 0xFFFFFFFF


def _number(value: object) -> object:
    """An integer, or one in hexadecimal as a text."""
    if not isinstance(value, str):
        return value
    try:
        return int(value, 16 if value.lower().startswith("0x") else 10)
    except ValueError:
        raise refusal(f'must be a whole number such as 5 or "0x1F", is "{value}"') from None


def _object(value: object) -> object:
    """An object's index and sub-index as index << 8 | sub: "0x6066" or "0x60C2:02"."""
    index, _, sub = str(value).partition(":")
    try:
        numbers = int(index, 16), int(sub or "0", 16)
    except ValueError:
        numbers = -1, -1
    if not (str(value).startswith("0x") and 0 < numbers[0] <= 0xFFFF and 0 <= numbers[1] <= 0xFF):
        raise refusal(f'must be an object such as "0x60C2:02", is "{value}"')
    return numbers[0] << 8 | numbers[1]


Number = Annotated[int, BeforeValidator(_number), Field(ge=0, le=_MOST)]
Value = Annotated[int, BeforeValidator(_number), Field(ge=-(2**31), le=_MOST)]
Object = Annotated[int, BeforeValidator(_object)]
Factor = Annotated[float, Field(gt=0, le=1e6)]


def _values(value: object) -> object:
    """`{object: value}` with objects as numbers, which JSON's keys are not."""
    return tuple(value.items()) if isinstance(value, Mapping) else value


Values = Annotated[tuple[tuple[Object, Value], ...], BeforeValidator(_values), Field(min_length=1)]
"""Objects and a value of each."""


class Fact(Section, Generic[T]):
    """A fact.

    Attributes:
        value: what is the case.
        source: who says so.
        tested: "no", or on what.
    """

    value: T
    source: Text
    tested: Text


class Identity(Section):
    """Identity object 0x1018:01 to :03. Of the revision only the major number counts."""

    vendor: Fact[Number]
    product: Fact[Number]
    revision: Fact[Number] | None = None


class Profile(Section):
    """A family of drives.

    Attributes:
        family: name of the profile.  drives: what it is of.
        identity: None: not known; a machine file then has to name the profile.
        modes: that work.  modes_claimed: 0x6502.  csp_mode: value of 0x6060 that selects csp.
        position_unit, velocity_unit, acceleration_unit: CiA 303-2.
        rated_force_unit: one count of 0x6076 [N m], of a linear motor [N].
        force_of: what 0x60B2 and 0x6077 are 1/1000 of.
        force_factors: what their counts may have to be multiplied by; several: by a setting.
        offset_bits, force_bits: of 0x60B2 and 0x6077.
        offset_sign: -1: 0x60B2 acts against the direction of positions.
        heartbeat: of its 0x1017 [s].  boot_timeout, enable_timeout: as in a machine file [s].
        warnings: EMCY codes that have to stop the axes though the error register is 0.
        absent: objects that it lacks.
        values: of objects after power-on.  only: objects that take this value alone.
        pdo_entries: most objects in a PDO.  tpdos: how many it has.
        long_answers: SDO answers are of four bytes, however short the object.
        homing_attained: statusword bit 12 in homing.
        in_sync: statusword bit 8 says that it is synchronised.
        demand_delay: SYNCs by which csp follows later than CiA 402 has it.
        interpolates: csp runs in a straight line from setpoint to setpoint.
        remarks: what else is known.
    """

    family: Family
    drives: Text
    identity: Identity | None = None
    modes: Fact[tuple[ModeName, ...]] | None = None
    modes_claimed: Fact[Number] | None = None
    csp_mode: Fact[Annotated[int, Field(ge=-128, le=127)]] | None = None
    position_unit: Fact[Number] | None = None
    velocity_unit: Fact[Number] | None = None
    acceleration_unit: Fact[Number] | None = None
    rated_force_unit: Fact[Factor] | None = None
    force_of: Fact[Literal["rated torque", "rated current", "standstill torque"]] | None = None
    force_factors: Fact[tuple[Factor, ...]] | None = None
    offset_bits: Fact[Literal[16, 32]] | None = None
    force_bits: Fact[Literal[16, 32]] | None = None
    offset_sign: Fact[Literal[1, -1]] | None = None
    heartbeat: Fact[Annotated[float, Field(ge=0.01, le=1.0)]] | None = None
    boot_timeout: Fact[Annotated[float, Field(ge=1e-3, le=600.0)]] | None = None
    enable_timeout: Fact[Annotated[float, Field(ge=1e-3, le=600.0)]] | None = None
    warnings: Fact[tuple[Annotated[Number, Field(ge=0x100, le=0xFFFF)], ...]] | None = None
    absent: Fact[tuple[Object, ...]] | None = None
    values: Fact[Values] | None = None
    only: Fact[Values] | None = None
    pdo_entries: Fact[Annotated[int, Field(ge=1, le=64)]] | None = None
    tpdos: Fact[Annotated[int, Field(ge=1, le=512)]] | None = None
    long_answers: Fact[bool] | None = None
    homing_attained: Fact[bool] | None = None
    in_sync: Fact[bool] | None = None
    demand_delay: Fact[Annotated[float, Field(ge=-10, le=100)]] | None = None
    interpolates: Fact[bool] | None = None
    remarks: tuple[Fact[Text], ...] = ()

    def facts(self) -> dict[str, Any]:
        """What is known, by field; without remarks."""
        return {name: fact.value for name, fact in self if isinstance(fact, Fact)}
