"""What fuzz cases are made of: edits of files, and frames of somebody else on the bus."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from functools import cache

import numpy as np

from hil_sim.cia301 import Dictionary

Edit = tuple[str, float, float, int]
"""What is done, from where to where (shares of the file), and a byte."""
EDITS = ("change", "cut", "double", "move", "truncate", "insert", "bit")
Frame = tuple[int, bytes]
AT_DRIVES = (
    0x000, 0x080, 0x201, 0x202, 0x301, 0x302, 0x401, 0x502, 0x601, 0x602, 0x601, 0x602, 0x701, 0x77F
)  # fmt: skip
AT_DRIVER = (0x081, 0x082, 0x181, 0x182, 0x581, 0x582, 0x701, 0x702, 0x000, 0x080, 0x201, 0x77F)
"""Ids that virtual drives listen to; that the driver does."""


def edited(data: bytes, edits: Sequence[Edit]) -> bytes:
    """A file after some edits."""
    for what, begin, end, value in edits:
        first, last = sorted((round(begin * len(data)), round(end * len(data))))
        last = min(last, first + 4096)
        piece = data[first:last]
        match what:
            case "change":
                data = data[:first] + bytes((value,)) + data[first + 1 :]
            case "bit":
                flipped = bytes(b ^ 1 << value % 8 for b in data[first : first + 1])
                data = data[:first] + flipped + data[first + 1 :]
            case "cut":
                data = data[:first] + data[first + value % 64 :]
            case "double":
                data = data[:last] + piece + data[last:]
            case "move":
                rest = data[:first] + data[last:]
                at = value * len(rest) // 256
                data = rest[:at] + piece + rest[at:]
            case "truncate":
                data = data[:first]
            case "insert":
                data = data[:first] + _TOKENS[value % len(_TOKENS)] + data[first:]
    return data


_TOKENS = (
    b"\x00", b"\xff\xfe", b"-1", b"1e999", b"nan", b".inf", b"0x", b"99999999999999999999", b": ",
    b"[", b"{", b"}", b"\n", b"\n  ", b"- ", b"&a ", b"*a", b"!!python/object:os.system ", b"'",
    b'"', b"%", b"$NODEID", b"null", b"true", b"\t", b"#", b"---\n", b"0", b"-", b".", b"=", b"]",
)  # fmt: skip


def random_edits(random: np.random.Generator) -> list[Edit]:
    """One to six edits."""
    return [
        (
            str(random.choice(EDITS)),
            float(random.random()),
            float(random.random()),
            int(random.integers(256)),
        )
        for _ in range(int(random.integers(1, 7)))
    ]


def random_frames(random: np.random.Generator, ids: Sequence[int], count: int) -> list[Frame]:
    """Frames with these ids, some of them SDO accesses to real objects, and now and then others."""
    frames = []
    objects = _objects()
    for _ in range(count):
        if random.random() < 0.3:
            index, sub = objects[int(random.integers(len(objects)))]
            command = int(
                random.choice([0x2F, 0x2B, 0x23, 0x40, 0x21, 0xA0, 0xC2, 0x4B, 0x60, 0x80])
            )
            value = (
                random.bytes(4)
                if random.random() < 0.5
                else bytes((int(random.integers(9)), 0, 0, 0))
            )
            server = int(random.choice([i for i in ids if i & 0x780 in (0x580, 0x600)]))
            frames.append((server, struct.pack("<BHB", command, index, sub) + value))
            continue
        can_id = int(random.choice(ids)) if random.random() < 0.9 else int(random.integers(0x800))
        frames.append((can_id, random.bytes(int(random.choice([8, 8, 8, 0, 1, 2, 3, 4, 5, 6, 7])))))
    return frames


@cache
def _objects() -> tuple[tuple[int, int], ...]:
    """Index and sub-index of all that the EDS lists."""
    return tuple((k >> 8, k & 0xFF) for k in Dictionary(1).variables)


def calm(frame: Frame) -> Frame:
    """The frame without "enable operation" (controlword bit 3), where it carries a controlword."""
    can_id, data = frame
    if can_id & 0x780 == 0x200 and data:
        return can_id, bytes((data[0] & ~8,)) + data[1:]
    if can_id & 0x780 == 0x600 and len(data) > 4 and data[1:3] == b"\x40\x60":
        return can_id, data[:4] + bytes((data[4] & ~8,)) + data[5:]
    return frame
