"""Drives that lack an object, refuse or round it, or answer SDO oddly: driven, or refused.

Each of 40 objects is missing, refused or rounded on writing, one at a time. What refuses a drive is
one line before power, and nothing hangs.
"""

import pytest
from canopen import SdoAbortedError

from drivers.errors import NodeError
from drivers.objects import ObjectRef
from hil_sim.cia301 import key
from hil_sim.habits import Habits
from tests.hil.test_families import ENABLE, operate
from tests.lockstep import open_on, switch_on

GENERAL, STATE = 0x08000000, 0x08000022
WORKS, REFUSED = "works", "refused"
OBJECTS = {
    0x1000: (REFUSED, WORKS, WORKS), 0x1001: (WORKS, WORKS, WORKS),
    0x1005: (REFUSED, WORKS, WORKS), 0x1006: (WORKS, WORKS, WORKS),
    0x1007: (WORKS, WORKS, WORKS), 0x1014: (WORKS, WORKS, WORKS),
    0x1016: (REFUSED, REFUSED, REFUSED), 0x1017: (REFUSED, REFUSED, REFUSED),
    0x1018: (REFUSED, WORKS, WORKS), 0x1019: (WORKS, WORKS, WORKS),
    0x1400: (REFUSED, REFUSED, REFUSED), 0x1600: (REFUSED, REFUSED, REFUSED),
    0x1800: (REFUSED, REFUSED, REFUSED), 0x1A00: (REFUSED, REFUSED, REFUSED),
    0x6007: (WORKS, WORKS, REFUSED), 0x603F: (WORKS, WORKS, WORKS),
    0x6040: (REFUSED, WORKS, WORKS), 0x6041: (REFUSED, WORKS, WORKS),
    0x605A: (WORKS, WORKS, WORKS), 0x605E: (WORKS, WORKS, WORKS),
    0x6060: (REFUSED, REFUSED, REFUSED), 0x6061: (REFUSED, WORKS, WORKS),
    0x6064: (REFUSED, WORKS, WORKS), 0x6065: (WORKS, WORKS, WORKS),
    0x6066: (WORKS, WORKS, WORKS), 0x6067: (WORKS, WORKS, WORKS),
    0x6068: (WORKS, WORKS, WORKS), 0x6072: (WORKS, WORKS, WORKS),
    0x6076: (WORKS, WORKS, WORKS), 0x6077: (WORKS, WORKS, WORKS),
    0x607A: (REFUSED, WORKS, WORKS), 0x607C: (WORKS, WORKS, WORKS),
    0x607D: (WORKS, WORKS, WORKS), 0x6081: (REFUSED, REFUSED, WORKS),
    0x6083: (REFUSED, WORKS, WORKS), 0x6085: (WORKS, WORKS, WORKS),
    0x6098: (REFUSED, REFUSED, REFUSED), 0x6099: (WORKS, WORKS, WORKS),
    0x60B2: (WORKS, WORKS, WORKS), 0x60C2: (WORKS, WORKS, WORKS),
}  # fmt: skip
"""Outcome where the object is missing, where writing it is refused, and where it is rounded."""


def missing(index):
    return {"habits": Habits(absent=tuple(key(index, sub) for sub in range(256)))}


def on_write(index, change):
    """SDO writes of an object are changed, or refused."""

    def alter(drive):
        store = drive.dictionary.set_data

        def set_data(at, sub, data, check_writable=False):
            store(at, sub, change(data) if at == index else data, check_writable=check_writable)

        drive.dictionary.set_data = set_data

    return {"alter": alter}


def refuse(data):
    raise SdoAbortedError(STATE)


def rounded(data):
    return bytes((data[0] & 0xF0, *data[1:])) if data else data


KINDS = {
    "missing": missing,
    "refusing": lambda index: on_write(index, refuse),
    "rounding": lambda index: on_write(index, rounded),
}


def test_there_are_forty():
    assert len(OBJECTS) == 40


@pytest.mark.parametrize("index", OBJECTS, ids=hex)
@pytest.mark.parametrize("kind", KINDS)
def test_one_object_at_a_time(kind, index, stage_machine):
    _, words, _, error = operate(stage_machine, **KINDS[kind](index))
    judged(error, words, OBJECTS[index][list(KINDS).index(kind)])
    if kind == "missing" and error is not None:
        assert f"0x{index:04X}:" in str(error)


def judged(error, words, expected):
    """It works, or one line tells why before power."""
    if error is not None:
        assert ENABLE not in words, error
        text = str(error)
        assert text.startswith("axis x: ")
        assert "\n" not in text
    assert (WORKS if error is None else REFUSED) == expected, error


def answers(change):
    """What `change` makes of the SDO answers of axis x: data, a list of them, or None."""
    return {"script": lambda can_id, data: change(data) if can_id == 0x581 else data}


def late():
    """Each answer comes when the next one is due."""
    held = []

    def change(data):
        held.append(data)
        return held.pop(0) if len(held) > 1 else None

    return answers(change)


def every(number, change):
    """Every so many answers are changed."""
    count = [0]

    def counted(data):
        count[0] += 1
        return data if count[0] % number else change(data)

    return answers(counted)


def aborted(data):
    return bytes((0x80, *data[1:4])) + GENERAL.to_bytes(4, "little")


ODD = {
    "twice": (lambda: answers(lambda data: [data, data]), REFUSED),
    "late": (late, REFUSED),
    "aborting": (lambda: answers(aborted), REFUSED),
    "aborting now and then": (lambda: every(17, aborted), REFUSED),
    "silent": (lambda: answers(lambda _: None), REFUSED),
    "losing one now and then": (lambda: every(7, lambda _: None), WORKS),
    "of another object": (lambda: every(5, lambda d: bytes((d[0], d[1] ^ 1, *d[2:]))), WORKS),
    "short": (lambda: every(5, lambda data: data[:7]), WORKS),
    "of an unknown service": (lambda: every(5, lambda data: bytes((0xFF, *data[1:]))), WORKS),
}
"""SDO answers that are odd, and the outcome; what is lost is asked for again."""


@pytest.mark.parametrize("oddity", ODD)
def test_odd_answers(oddity, stage_machine):
    made, expected = ODD[oddity]
    _, words, _, error = operate(stage_machine, **made())
    judged(error, words, expected)


def test_a_wrong_toggle_bit_ends_the_read(stage_machine):
    def toggled(data):
        is_segment = data[0] & 0xE0 == 0x00
        return bytes((data[0] ^ 0x10, *data[1:])) if is_segment else data

    drives, world = switch_on(stage_machine, alter=answers(toggled)["script"])
    with open_on(world, stage_machine) as stage:
        stage.boot()
        name = ObjectRef(0x1008, 0, "manufacturer device name")
        with pytest.raises(NodeError, match=r"^axis x: 0x1008:00 .*does not answer"):
            stage.axes[0].node.read_value(name)
        assert stage.axes[0].node.read(ObjectRef(0x1000, 0, "device type")) & 0xFFFF == 402
    assert drives
