"""The seal on an answer: a hash that is shown before a diagnosis, and what opens it afterwards."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from sim2real.blind.draw import Drawn, Key


@dataclass(frozen=True, slots=True)
class Sealed:
    """An answer under seal.

    Attributes:
        text: the key as JSON.
        nonce: random text, so that the hash can't be found by trying keys.
        digest: SHA-256 of text and nonce, hexadecimal.
    """

    text: str
    nonce: str
    digest: str

    def verifies(self) -> bool:
        """Whether text and nonce are those that the digest was made of."""
        return digest_of(self.text, self.nonce) == self.digest


def seal(key: Key, rng: np.random.Generator) -> Sealed:
    """Put a key under seal."""
    text = json.dumps(key_json(key), sort_keys=True)
    nonce = rng.bytes(16).hex()
    return Sealed(text, nonce, digest_of(text, nonce))


def digest_of(text: str, nonce: str) -> str:
    """SHA-256 of a key's text followed by a nonce: `printf %s%s TEXT NONCE | sha256sum`."""
    return hashlib.sha256((text + nonce).encode()).hexdigest()


def key_json(key: Key) -> dict[str, Any]:
    """A key as plain values."""
    return {
        "kind": key.kind,
        "effects": [asdict(drawn) for drawn in key.effects],
        "base": {axis: dict(off) for axis, off in key.base.items()},
    }


def key_of(values: Mapping[str, Any]) -> Key:
    """A key from plain values."""
    return Key(values["kind"], tuple(Drawn(**drawn) for drawn in values["effects"]), values["base"])
