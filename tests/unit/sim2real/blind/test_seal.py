"""The seal on an answer."""

from __future__ import annotations

import json

import numpy as np

from sim2real.blind.seal import key_digest, key_json, seal_key
from tests.unit.sim2real.blind.conftest import drawn


def test_the_seal_opens_with_its_key_and_no_other(stage):
    key = drawn(stage, 4)
    sealed = seal_key(key, np.random.default_rng(1))
    assert sealed.text == json.dumps(key_json(key), sort_keys=True)
    assert key_digest(sealed.text, sealed.nonce) == sealed.digest
    assert key_digest(sealed.text.replace("0", "1", 1), sealed.nonce) != sealed.digest
    assert key_digest(sealed.text, "00" * 16) != sealed.digest
    assert seal_key(key, np.random.default_rng(2)).digest != sealed.digest
    assert len(key_digest("", "")) == 64
