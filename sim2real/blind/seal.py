"""The seal on an answer: a hash published before the diagnosis, and what opens it afterwards."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from sim2real.blind.draw import Key


@dataclass(frozen=True, slots=True)
class Sealed:
    """An answer under seal.

    Attributes:
        text: the key as JSON.
        nonce: random text, so that the hash cannot be found by trying keys.
        digest: SHA-256 of text and nonce, hexadecimal.
    """

    text: str
    nonce: str
    digest: str


def seal_key(key: Key, rng: np.random.Generator) -> Sealed:
    """Seal a key."""
    text = json.dumps(key_json(key), sort_keys=True)
    nonce = rng.bytes(16).hex()
    return Sealed(text, nonce, key_digest(text, nonce))


def key_digest(text: str, nonce: str) -> str:
    """SHA-256 of a key's text followed by a nonce: `printf %s%s TEXT NONCE | sha256sum`."""
    return hashlib.sha256((text + nonce).encode()).hexdigest()


def key_json(key: Key) -> dict[str, Any]:
    """A key as plain values."""
    return {
        "kind": key.kind,
        "effects": [asdict(drawn) for drawn in key.effects],
        "base": {axis: dict(off) for axis, off in key.base.items()},
    }
