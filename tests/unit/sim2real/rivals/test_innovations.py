"""Coordinates that innovations show."""

from dataclasses import replace

import numpy as np
import pytest

from hil_sim.effects.library import library
from hil_sim.plant import simulate
from sim2real.blind.unlisted_effects import UNLISTED
from sim2real.fitting import NUISANCES, AxisModel, Term
from sim2real.gap import prepare_replay
from sim2real.rivals import Innovations
from tests.unit.sim2real.conftest import problem_of

KNOWN = {effect.name: effect for effect in UNLISTED}


@pytest.fixture(scope="module")
def innovations_of(nominal):
    """Innovations of axis x of the stage with an effect on no list; None for none."""
    recording, settings = nominal

    def innovations(name=None, **values):
        effects = () if name is None else (KNOWN[name].at(**values),)
        axes = tuple(
            replace(axis, effects=effects) if axis.name == "x" else axis for axis in settings.axes
        )
        replay = prepare_replay(recording, settings)
        run = simulate(replace(settings, axes=axes), replay.demand, replay.offset, seed=3)
        signals = {
            axis: replace(of, position_actual=run.position[:, a], force_actual=run.force[:, a])
            for a, (axis, of) in enumerate(recording.axes.items())
        }
        return Innovations(problem_of(replace(recording, axes=signals), settings))

    return innovations


@pytest.fixture(scope="module")
def pulled(innovations_of):
    return innovations_of("force_bump", force=0.9, center=-0.01, width=0.006)


def test_a_force_that_the_wander_of_friction_hides_has_its_coordinate_and_course(pulled):
    (found,) = pulled.unlisted()
    assert (found.axis, found.over, found.times) == ("x", "position", "")
    curve, low = found.curve, found.gap_closed_interval[0]
    assert 0.0 < low <= found.gap_closed <= 1.0
    at = np.asarray(curve.at)
    bump = 0.9 * np.exp(-0.5 * ((at + 0.01) / 0.006) ** 2)
    assert np.corrcoef(bump, curve.force)[0, 1] > 0.9
    assert np.ptp(curve.force) == pytest.approx(0.9, rel=1.0 / 3.0)


def test_a_scale_that_misreads_shows_its_error_over_position(innovations_of):
    (found,) = innovations_of("scale_error", error=2e-6, pitch=0.0127, phase=3.5).unlisted()
    assert (found.over, found.times) == ("position", "reading")
    # What accelerates the mass is the bend of the error: one that hardly bends does not show.
    at = np.asarray(found.curve.at)
    error, known = (
        np.diff(course, 2)
        for course in (found.curve.force, 2e-6 * np.sin(2.0 * np.pi * at / 0.0127 + 3.5))
    )
    assert np.corrcoef(known, error)[0, 1] > 0.9
    assert np.ptp(error) == pytest.approx(np.ptp(known), rel=1.0 / 3.0)


def test_effects_that_explain_as_much_keep_their_names(pulled):
    assert not pulled.instead_of([])
    near, far = (
        AxisModel(np.zeros(NUISANCES), (Term(KNOWN["force_bump"], values),))
        for values in ((0.9, -0.01, 0.006), (0.9, 0.03, 0.006))
    )
    cable = AxisModel(np.zeros(NUISANCES), (Term(library()["cable_stiffness"], (5.0, 0.0)),))
    assert not pulled.instead_of([near])
    assert pulled.instead_of([far, cable]) == pulled.unlisted()


def test_a_model_that_leaves_less_than_noise_keeps_its_names(pulled, monkeypatch):
    """A perfect one may be lucky, and so may a curve be: half of less than nothing is more."""
    model = AxisModel(np.zeros(NUISANCES), (Term(KNOWN["force_bump"], (0.9, -0.01, 0.006)),))
    found = pulled.unlisted()
    monkeypatch.setitem(vars(pulled), "_ranking", [(-0.012, None, None, None)])
    monkeypatch.setattr(pulled, "unlisted", lambda: found, raising=False)
    for left, given in ((-0.016, ()), (0.01, found)):
        monkeypatch.setattr(pulled, "_left_by", lambda _, left=left: left, raising=False)
        assert pulled.instead_of([model]) == given


def test_noise_has_no_coordinate(innovations_of):
    assert not innovations_of().unlisted()
