"""Messages as msgpack, and blocks of samples as raw little-endian arrays in it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import msgpack
import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from stagectl.errors import UnusableInput
from stagectl.protocol.message import VERSION, Message
from stagectl.protocol.requests import Request
from stagedata import F64

MOST = 2 << 20
"""Bytes of a request."""
STATE, NOTICE, SAMPLES, FRAMES = b"state", b"notice", b"samples", b"frames"
"""Topics that a server publishes."""


def encode(message: Message) -> bytes:
    """A message as bytes."""
    packed: bytes = msgpack.packb(message.model_dump(mode="python"))
    return packed


def unpack(data: bytes, use_list: bool = True) -> Any:
    """Plain values of msgpack, arrays as lists or tuples.

    Raises:
        UnusableInput: it is none, or too large.
    """
    if len(data) > MOST:
        raise UnusableInput(f"a message of {len(data)} bytes: at most {MOST} are read")
    try:
        return msgpack.unpackb(data, use_list=use_list, max_str_len=MOST, max_bin_len=MOST)
    except (ValueError, TypeError, RecursionError, msgpack.UnpackException) as why:
        raise UnusableInput(f"not a message in msgpack: {type(why).__name__}") from why


def decode_request(data: bytes) -> Request:
    """A request.

    Raises:
        UnusableInput: version, a key or a value is not understood; in one line.
    """
    plain = unpack(data, use_list=False)
    if not isinstance(plain, dict):
        raise UnusableInput("a request is a map")
    if (version := plain.get("version")) != VERSION:
        raise UnusableInput(
            f"version: this server speaks {VERSION}, the request {str(version)[:20]!r}"
        )
    try:
        return Request.model_validate(plain, strict=True)
    except ValidationError as why:
        raise UnusableInput(one_problem(why)) from why


def one_problem(why: ValidationError) -> str:
    """The first problem of a message in one line: where it is, and what is wrong."""
    first = why.errors(include_url=False, include_input=False)[0]
    where = ".".join(str(part) for part in first["loc"])
    return f"{where}: {first['msg']}" if where else str(first["msg"])


@dataclass(frozen=True, slots=True)
class SampleBlock:
    """Consecutive samples of all axes, n of them.

    Attributes:
        first: number of the first sample since the server began.
        time: of the SYNCs, float64[K]; on the clock of the bus [s].
        late: uint8[K], 1 where SYNC left late.
        demand, position, force, offset: float64[K, n] [m], [m], [N], [N].
        statusword: uint16[K, n].
        valid: uint8[K, n], 0 where the TPDO was missed.
    """

    first: int
    time: F64
    late: NDArray[np.uint8]
    demand: F64
    position: F64
    force: F64
    offset: F64
    statusword: NDArray[np.uint16]
    valid: NDArray[np.uint8]

    def encode(self) -> bytes:
        """As bytes; arrays in C order, little-endian."""
        fields: dict[str, Any] = {"version": VERSION, "first": self.first}
        for name, kind in _ARRAYS.items():
            fields[name] = np.ascontiguousarray(getattr(self, name), kind).tobytes()
        fields["axes"] = self.position.shape[1]
        packed: bytes = msgpack.packb(fields)
        return packed

    @classmethod
    def decode(cls, data: bytes) -> SampleBlock:
        """Of bytes.

        Raises:
            UnusableInput: not a block of this version.
        """
        plain = unpack(data)
        if not isinstance(plain, dict) or plain.get("version") != VERSION:
            raise UnusableInput(f"not a block of samples of version {VERSION}")
        axes = int(plain["axes"])
        made: dict[str, Any] = {}
        for name, kind in _ARRAYS.items():
            array = np.frombuffer(plain[name], kind)
            made[name] = array if name in ("time", "late") else array.reshape(-1, axes)
        return cls(first=int(plain["first"]), **made)


_ARRAYS = {
    "time": "<f8", "late": "u1", "demand": "<f8", "position": "<f8", "force": "<f8",
    "offset": "<f8", "statusword": "<u2", "valid": "u1",
}  # fmt: skip
