"""A recipe made to tell effects apart runs on the virtual stage, and excites the whole band."""

from __future__ import annotations

import numpy as np
import pytest
import yaml
from click.testing import CliRunner

from stagectl.cli.gap_excite import excite
from stagectl.cli.run import command as run
from stagectl.store import read_recording


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    folder = tmp_path_factory.mktemp("excite")
    recipe = folder / "excite.yaml"
    for used, *arguments in (
        [excite, "--axis", "x", "--out", recipe],
        [run, recipe, "--simulate", "--out", folder / "run", "--history", folder / "history.db"],
    ):
        done = CliRunner().invoke(used, [str(a) for a in arguments])
        assert done.exit_code == 0, done.output
    return recipe, read_recording(folder / "run" / "recording.h5")


def test_all_parts_are_there(recorded):
    recipe, recording = recorded
    moves = yaml.safe_load(recipe.read_text())["moves"]
    assert sum("excite" in move for move in moves) == 2
    assert len({move.get("velocity") for move in moves if "to" in move}) > 3
    x = recording.axes["x"]
    speed = np.abs(np.diff(x.position_demand)) / 1e-3
    assert speed.max() > 0.25
    assert np.mean((speed > 0.005) & (speed < 0.04)) > 0.1, "slow sweeps"


def test_the_response_follows_the_demand_over_the_band(recorded):
    _, recording = recorded
    x = recording.axes["x"]
    longest = max(
        (m for m in recording.moves if m.kind == "other" and m.origin == m.target),
        key=lambda m: m.end - m.start,
    )
    demand = x.position_demand[longest.start : longest.end]
    assert np.ptp(demand) > 20e-6
    power = np.abs(np.fft.rfft(np.diff(demand, 2))) ** 2
    frequency = np.fft.rfftfreq(len(demand) - 2, 1e-3)
    for low in (4.0, 16.0, 64.0):
        assert power[(frequency > low) & (frequency < 2 * low)].sum() > 1e-4 * power.sum()
    assert np.corrcoef(demand, x.position_actual[longest.start : longest.end])[0, 1] > 0.8
