"""The seal on an answer."""

from __future__ import annotations

import json
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

from hil_sim.effects.library import own_effects
from hil_sim.settings import StageSettings
from sim2real.blind import (
    Key,
    draw_key,
    key_digest,
    key_json,
    seal_key,
)
from stagectl.config.machine_file import load_machine
from stagectl.config.package_settings import stage_settings

LIBRARY = own_effects()
TOLERANCE = {"x": 0.003, "y": 0.003}


@pytest.fixture(scope="module")
def stage() -> StageSettings:
    data = Path(str(resources.files("stagectl"))) / "data"
    return stage_settings(load_machine(data / "machines" / "wafer-xy.yaml"))


def drawn(stage: StageSettings, seed: int, kind: str | None = None) -> Key:
    rng = np.random.default_rng(seed)
    return draw_key(rng, stage, TOLERANCE, LIBRARY, lambda _: 3.0, kind=kind)


def test_the_seal_opens_with_its_key_and_no_other(stage: StageSettings) -> None:
    key = drawn(stage, 4)
    sealed = seal_key(key, np.random.default_rng(1))
    assert sealed.text == json.dumps(key_json(key), sort_keys=True)
    assert key_digest(sealed.text, sealed.nonce) == sealed.digest
    assert key_digest(sealed.text.replace("0", "1", 1), sealed.nonce) != sealed.digest
    assert key_digest(sealed.text, "00" * 16) != sealed.digest
    assert seal_key(key, np.random.default_rng(2)).digest != sealed.digest
    assert len(key_digest("", "")) == 64
