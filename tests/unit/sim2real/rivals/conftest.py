"""Curves of an axis with an effect, and stand-ins for them."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from hil_sim.plant import simulate
from sim2real.gap import prepare_replay
from sim2real.open_loop import MotionLoop, measure_motion
from sim2real.rivals import Rivals, Screen
from sim2real.rivals.coordinates import Coordinate
from sim2real.rivals.grouped_fit import Prediction
from sim2real.rivals.screen import Curve
from tests.unit.sim2real.conftest import TOLERANCE


@pytest.fixture(scope="module")
def screen_of(nominal):
    """Curves of axis x of the stage with an effect; None for none."""
    recording, settings = nominal

    def screen(effect=None, read=lambda x: x, demand=None, **values):
        replay = prepare_replay(recording, settings)
        demand = replay.demand if demand is None else demand
        axes = tuple(
            replace(axis, effects=(effect.at(**values),)) if effect and axis.name == "x" else axis
            for axis in settings.axes
        )
        run = simulate(replace(settings, axes=axes), demand, replay.offset, seed=3)
        signals = {
            name: replace(
                of, position_actual=read(run.position[:, a]), force_actual=run.force[:, a]
            )
            for a, (name, of) in enumerate(recording.axes.items())
        }
        motion = measure_motion(replace(recording, axes=signals), settings)
        return Screen(MotionLoop("x", [motion], settings, TOLERANCE["x"]))

    return screen


def rivals_of(nominal, gap, lost):
    """A curve that leaves noise; any model loses these shares of a gap to it, one of each move."""
    noise = np.full(len(lost), 100.0)
    best, name, nothing = (
        Prediction(energies, np.empty(0), np.empty(0), ())
        for energies in (noise, noise + lost * gap, noise + gap)
    )
    screen = SimpleNamespace(
        open=nothing, floor=noise.sum(), model=lambda _: name, linear=lambda _: None,
        loop=SimpleNamespace(axis=nominal[1].axes[0]), extent=lambda _: (-0.05, 0.05),
    )  # fmt: skip
    none = np.empty(0)
    return Rivals(screen, [Curve(Coordinate("velocity", "velocity"), none, none, none, best)])
