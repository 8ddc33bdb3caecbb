"""Every object that the host writes, and what it counts.

That it writes no other: tests/hil/test_drives_that_count_otherwise.py.
"""

import ast
from dataclasses import replace
from pathlib import Path

import pytest

import drivers
from drivers import objects as od
from drivers.drive import counts, dimension, unit
from drivers.errors import ConfigurationError
from drivers.objects import ObjectRef
from drivers.settings import AxisSettings

LENGTH, SPEED, RATE, FORCE = (2e-9, "m"), (3e-6, "m/s"), (5e-4, "m/s^2"), (0.05, "N")
MILLISECONDS, MICROSECONDS, CODE = (1e-3, "s"), (1e-6, "s"), (1.0, "")

CODES = (
    "0x1005:00", "0x1016:01", "0x1019:00", "0x6007:00", "0x6040:00", "0x605A:00", "0x605B:00",
    "0x605C:00", "0x605D:00", "0x605E:00", "0x6060:00", "0x6098:00", "0x60C2:01", "0x60C2:02",
)  # fmt: skip
WRITTEN = {
    "0x607A:00": LENGTH,  # target position
    "0x6065:00": LENGTH,  # following error window
    "0x6066:00": MILLISECONDS,
    "0x6067:00": LENGTH,  # position window
    "0x6068:00": MILLISECONDS,
    "0x607C:00": LENGTH,  # home offset
    "0x607D:01": LENGTH,  # software limits
    "0x607D:02": LENGTH,
    "0x6081:00": SPEED,  # profile
    "0x6083:00": RATE,
    "0x6084:00": RATE,
    "0x6085:00": RATE,  # quick stop
    "0x6099:01": SPEED,  # homing
    "0x6099:02": SPEED,
    "0x609A:00": RATE,
    "0x60FF:00": SPEED,  # target velocity
    "0x6071:00": FORCE,  # target torque
    "0x6072:00": FORCE,  # max torque
    "0x60B2:00": FORCE,  # torque offset
    "0x1006:00": MICROSECONDS,
    "0x1007:00": MICROSECONDS,
    "0x1017:00": MILLISECONDS,
    **dict.fromkeys(CODES, CODE),
}
"""SI value and dimension of one unit on `AXIS`."""
READ = {"0x6064:00": LENGTH, "0x606C:00": SPEED, "0x6077:00": FORCE}

AXIS = AxisSettings(
    name="x", node=1, eds=Path("x.eds"), rated_force=50.0, peak_force=100.0, travel=(-0.1, 0.1),
    velocity=1.0, acceleration=10.0, jerk=1e3, following_error=1e-3, increment=2e-9,
    velocity_unit=3e-6, acceleration_unit=5e-4,
)  # fmt: skip
OBJECTS = {str(o)[:9]: o for o in vars(od).values() if isinstance(o, ObjectRef)}


def test_the_table_is_complete():
    known = {place for place, ref in OBJECTS.items() if ref.quantity is not None}
    assert known == set(WRITTEN) | set(READ)


@pytest.mark.parametrize("place", [*WRITTEN, *READ])
def test_each_object_has_its_unit(place):
    size, si = (WRITTEN | READ)[place]
    ref = OBJECTS[place]
    assert unit(AXIS, ref) == pytest.approx(size, rel=1e-12)
    assert dimension(AXIS, ref) == si
    assert counts(AXIS, ref, 7.4 * size) == 7
    assert counts(AXIS, ref, -7.6 * size) == -8


def test_a_rotary_axis_counts_angles_and_torques():
    turning = replace(AXIS, rotary=True)
    found = [dimension(turning, ref) for ref in (od.TARGET_POSITION, od.PROFILE_VELOCITY,
             od.QUICK_STOP_DECELERATION, od.MAX_FORCE, od.CYCLE_PERIOD, od.MODE)]  # fmt: skip
    assert found == ["rad", "rad/s", "rad/s^2", "N m", "s", ""]


def test_an_object_without_a_quantity_has_no_unit():
    with pytest.raises(
        ConfigurationError, match=r"^axis x: 0x1018:01 vendor id: has no unit that the host knows$"
    ):
        counts(AXIS, od.VENDOR_ID, 1.0)


@pytest.mark.parametrize("name", ["velocity_unit_si", "acceleration_unit_si", "rated_force"])
def test_units_become_integers_in_one_place(name):
    users = {
        f"{path.parent.name}/{path.name}"
        for path in Path(drivers.__file__).parent.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Attribute) and node.attr == name
    }
    # settings check their range, `units` compares the rated force in mN
    assert users <= {"drivers/settings.py", "drive/scaling.py", "drive/units.py"}
