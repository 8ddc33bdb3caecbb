"""The unit of every object that the host writes: the only place that turns SI values into integers.

An object's quantity is in `drivers.objects`; how large its unit is, in the axis' settings. That the
drive means the same is checked before power: `units`.

Sources: CiA 402-2, factor group 0x608F, 0x6091, 0x6092, and the units 0x60A8 to 0x60AA.
"""

from __future__ import annotations

from collections.abc import Callable

from drivers.errors import ConfigurationError
from drivers.objects import ObjectRef, Quantity
from drivers.settings import AxisSettings

_UNITS: dict[Quantity, tuple[str, Callable[[AxisSettings], float]]] = {
    Quantity.POSITION: ("m", lambda axis: axis.increment),
    Quantity.VELOCITY: ("m/s", lambda axis: axis.velocity_unit_si),
    Quantity.ACCELERATION: ("m/s^2", lambda axis: axis.acceleration_unit_si),
    Quantity.FORCE: ("N", lambda axis: axis.rated_force / 1000),
    Quantity.MILLISECONDS: ("s", lambda _: 1e-3),
    Quantity.MICROSECONDS: ("s", lambda _: 1e-6),
    Quantity.CODE: ("", lambda _: 1.0),
}
"""SI dimension of each quantity, and one unit of it on an axis."""
_ROTARY = {"m": "rad", "m/s": "rad/s", "m/s^2": "rad/s^2", "N": "N m"}


def unit(axis: AxisSettings, ref: ObjectRef) -> float:
    """SI value of one unit of an object.

    Raises:
        ConfigurationError: the object has no quantity in `drivers.objects`.
    """
    return _UNITS[_quantity(axis, ref)][1](axis)


def dimension(axis: AxisSettings, ref: ObjectRef) -> str:
    """SI dimension of an object ("m/s", "" for none); errors as `unit`."""
    text = _UNITS[_quantity(axis, ref)][0]
    return _ROTARY.get(text, text) if axis.rotary else text


def counts(axis: AxisSettings, ref: ObjectRef, value: float) -> int:
    """An SI value in an object's units, rounded; errors as `unit`."""
    return round(value / unit(axis, ref))


def _quantity(axis: AxisSettings, ref: ObjectRef) -> Quantity:
    if ref.quantity is None:
        raise ConfigurationError("has no unit that the host knows", axis=axis.name, obj=ref)
    return ref.quantity
