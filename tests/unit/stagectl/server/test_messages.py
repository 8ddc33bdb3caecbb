"""What clients send is checked to the last key; blocks of samples come back as they were."""

import msgpack
import numpy as np
import pytest

from stagectl.errors import UnusableInput
from stagectl.protocol.requests import Move, Request
from stagectl.protocol.wire import SampleBlock, decode_request, encode

GOOD = {"version": 1, "id": 1, "client": "test", "command": {"op": "info"}}


def with_command(**command):
    return GOOD | {"command": command}


HOSTILE = {
    "nothing": b"",
    "noise": b"\xc1\xff\x00",
    "text": b"home",
    "cut": msgpack.packb(GOOD)[:-3],
    "more than one": msgpack.packb(GOOD) + b"\x01",
    "deep": b"\x91" * 5000,
    "a list": [1, 2],
    "a number": 7,
    "no version": {"id": 1, "client": "a", "command": {"op": "info"}},
    "another version": GOOD | {"version": 2},
    "version as text": GOOD | {"version": "1"},
    "no id": {k: v for k, v in GOOD.items() if k != "id"},
    "negative id": GOOD | {"id": -1},
    "id as text": GOOD | {"id": "1"},
    "huge id": GOOD | {"id": 2**40},
    "no client": {k: v for k, v in GOOD.items() if k != "client"},
    "empty client": GOOD | {"client": ""},
    "long client": GOOD | {"client": "a" * 65},
    "client with an escape": GOOD | {"client": "a\x1b[2J"},
    "client with a line break": GOOD | {"client": "a\nb"},
    "client as bytes": GOOD | {"client": b"a"},
    "another key": GOOD | {"admin": True},
    "no command": {k: v for k, v in GOOD.items() if k != "command"},
    "command as text": GOOD | {"command": "home"},
    "no op": with_command(),
    "unknown op": with_command(op="reboot"),
    "private op": with_command(op="__class__"),
    "another key of a command": with_command(op="home", force=True, fast=True),
    "force as text": with_command(op="home", force="yes"),
    "move without a target": with_command(op="move", axis="x"),
    "move with two targets": with_command(op="move", axis="x", position=0.0, distance=0.0),
    "move to nan": with_command(op="move", axis="x", position=float("nan")),
    "move to infinity": with_command(op="move", axis="x", position=float("inf")),
    "move to text": with_command(op="move", axis="x", position="0.1"),
    "move of no axis": with_command(op="move", axis="", position=0.0),
    "move at no velocity": with_command(op="move", axis="x", position=0.0, velocity=0.0),
    "move backwards in velocity": with_command(op="move", axis="x", position=0.0, velocity=-1.0),
    "jog at nan": with_command(op="jog", axis="x", velocity=float("nan")),
    "wait for ever": with_command(op="wait", job=1, timeout=1e9),
    "wait for no time": with_command(op="wait", job=1, timeout=0.0),
    "stop with an escape": with_command(op="stop", reason="\x1b[31m"),
    "recipe too long": with_command(op="check_recipe", recipe="a" * 1_000_001, source="a"),
    "recipe as bytes": with_command(op="check_recipe", recipe=b"a", source="a"),
    "retries without end": with_command(
        op="queue_add", recipe="a", source="a", options={"retries": 10**6}
    ),
    "unknown compensation": with_command(
        op="queue_add", recipe="a", source="a", options={"compensation": "magic"}
    ),
    "object outside the dictionary": with_command(op="read_object", axis="x", index=0x10000),
    "subindex outside": with_command(op="read_object", axis="x", index=1, subindex=256),
    "object too long": with_command(op="write_object", axis="x", index=1, value=b"a" * 5000),
    "too large": b"\xc6" + (3 << 20).to_bytes(4, "big") + b"\x00" * (3 << 20),
}


@pytest.mark.parametrize("kind", HOSTILE)
def test_hostile_requests_are_refused_in_one_line(kind):
    data = HOSTILE[kind]
    data = data if isinstance(data, bytes) else msgpack.packb(data)
    with pytest.raises(UnusableInput) as refused:
        decode_request(data)
    assert "\n" not in str(refused.value)
    assert len(str(refused.value)) < 500


def test_a_request_comes_back_as_it_was():
    asked = Request(version=1, id=7, client="a", command=Move(axis="x", position=0.1))
    assert decode_request(encode(asked)) == asked


def test_samples_come_back_as_they_were():
    block = SampleBlock(
        first=5,
        time=np.arange(3) * 1e-3,
        late=np.array([0, 1, 0], np.uint8),
        demand=np.arange(6.0).reshape(3, 2),
        position=-np.arange(6.0).reshape(3, 2),
        force=np.ones((3, 2)),
        offset=np.zeros((3, 2)),
        statusword=np.full((3, 2), 0x1237, np.uint16),
        valid=np.ones((3, 2), np.uint8),
    )
    again = SampleBlock.decode(block.encode())
    assert again.first == 5
    for name in ("time", "late", "demand", "position", "force", "offset", "statusword", "valid"):
        assert np.array_equal(getattr(again, name), getattr(block, name)), name
