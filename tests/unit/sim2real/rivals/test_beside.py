"""Which effects a curve beside them takes, and which it leaves."""

from dataclasses import replace

import numpy as np
import pytest

from hil_sim.effects.library import library
from sim2real.blind.unlisted_effects import unlisted
from sim2real.fitting import NUISANCES, AxisModel, Term
from sim2real.gap import prepare_replay
from sim2real.rivals import Beside, find_rivals
from sim2real.rivals.coordinates import Coordinate
from tests.unit.sim2real.rivals.conftest import rivals_of
from tests.unit.sim2real.rivals.forces import (
    SIZE,
    drag,
    easing,
    splinter,
)

COGGING_AND_OIL = {"cogging": (1.5, 0.03, 0.0), "viscous_damping": (1.5,)}


@pytest.mark.parametrize(("lost", "given"), [(0.01, False), (0.05, True)])
def test_beside_names_a_coordinate_has_to_close_a_fiftieth_of_the_whole_gap(nominal, lost, given):
    rivals = rivals_of(nominal, 1e5, np.full(20, lost))
    (curve,) = rivals.curves
    rivals.screen.linear, rivals.screen.predict = lambda _: "linear", rivals.screen.model
    rivals.screen.curve = lambda over, _: curve if over == curve.coordinate else None
    rivals.screen.blocks = np.arange(20)
    rivals.screen.loop.name = "x"
    one = AxisModel(np.zeros(NUISANCES), (Term(library()["force_offset"], (1.5,)),))
    dropped, unlisted = Beside(rivals).doubts(one, kept=one.names())
    assert dropped == ()
    assert [found.over for found in unlisted] == (["velocity"] if given else [])


@pytest.fixture(scope="module")
def easing_beside_cogging(screen_of):
    """A screen of cogging and of a friction that falls, and the name that the first should keep."""

    @unlisted(SIZE, over="")
    def both(ports, p):
        ports.add_position_force(1.5 * np.sin(2.0 * np.pi * ports.positions / 0.03))
        easing.apply(ports, {"size": 0.4})

    return screen_of(both, size=1.0), Term(library()["cogging"], (1.5, 0.03, 0.0))


def test_a_name_that_partly_stands_for_a_function_of_time_goes(easing_beside_cogging):
    screen, cogging = easing_beside_cogging
    level = Term(library()["coulomb_level"], (1.15,))
    model = screen.loop.start.added(cogging).added(level)
    doubted, (found,) = Beside(find_rivals(screen)).doubts(model)
    assert doubted == ("coulomb_level",)
    assert (found.over, found.times) == ("time", "friction")
    assert found.gap_closed > 0.8


def test_a_name_and_a_curve_may_explain_what_neither_does_alone(easing_beside_cogging):
    screen, cogging = easing_beside_cogging
    rivals, start = find_rivals(screen), screen.loop.start
    curve = Beside(rivals).complement(start.added(cogging))
    assert curve is not None
    assert (curve.coordinate.over, curve.coordinate.times) == ("time", "friction")
    assert Beside(rivals).keep(start.added(cogging), curve)
    spring = start.added(Term(library()["cable_stiffness"], (20.0, 0.0)))
    assert Beside(rivals).complement(spring) is None
    assert not Beside(rivals).keep(spring, curve), "a curve over position does better"
    oil = Term(library()["viscous_damping"], (1.1,))
    assert Beside(rivals).beat(start.added(cogging), start.added(cogging).added(oil))


def test_an_effect_is_no_rival_of_what_was_found_before_it(screen_of):
    cogging, oil = (Term(library()[n], v) for n, v in COGGING_AND_OIL.items())

    @unlisted(SIZE, over="")
    def both(ports, p):
        for term in (cogging, oil):
            term.effect.apply(ports, term.mapping())

    rivals = find_rivals(screen_of(both, size=1.0))
    start = rivals.screen.loop.start
    assert not Beside(rivals).beat(start.added(cogging), start.added(cogging).added(oil))
    assert not Beside(rivals).beat(start.added(oil), start.added(oil).added(cogging))
    assert Beside(rivals).taken_together(start.added(oil).added(cogging)) == ()


def test_two_of_three_effects_that_one_curve_replaces_are_taken(screen_of):
    cogging = Term(library()["cogging"], COGGING_AND_OIL["cogging"])

    @unlisted(SIZE, over="")
    def both(ports, p):
        cogging.effect.apply(ports, cogging.mapping())
        drag.apply(ports, {"size": 60.0})

    rivals = find_rivals(screen_of(both, size=1.0))
    model = rivals.screen.loop.start.added(cogging)
    oil = Term(library()["viscous_damping"], (1.6,))
    level = Term(library()["coulomb_level"], (0.9,))
    assert Beside(rivals).taken_together(model.added(oil)) == (), "no curve does what both do"
    imitated = model.added(oil).added(level)
    assert Beside(rivals).taken_together(imitated) == ("viscous_damping", "coulomb_level")
    doubted, (found,) = Beside(rivals).doubts_of_complete(imitated)
    assert doubted == ("viscous_damping", "coulomb_level")
    assert found.over == "velocity"
    assert found.gap_closed > 0.9


def test_in_equal_strokes_drag_is_no_viscous_friction_and_cogging(screen_of, nominal):
    """What goes with velocity comes back at equal distances, with the pitch of the strokes."""
    replay, length = prepare_replay(*nominal), 8e-3
    cable = Term(library()["cable_stiffness"], (20.0, 0.0))

    @unlisted(SIZE, over="")
    def both(ports, p):
        cable.effect.apply(ports, cable.mapping())
        drag.apply(ports, {"size": 60.0})

    count = 300
    share = np.clip(np.arange(count) / 150.0, 0.0, 1.0)
    stroke = length * share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    demand = replay.demand.copy()
    at = np.minimum(np.arange(len(demand)) // count, 9)
    demand[:, 0] = -0.04 + length * at + stroke[np.arange(len(demand)) % count]
    demand[10 * count :, 0] = -0.04 + 10 * length
    rivals = find_rivals(screen_of(both, demand=demand, size=1.0))
    oil = Term(library()["viscous_damping"], (1.5,))
    wave = Term(library()["cogging"], (0.3, length, 0.5 * np.pi))
    model = rivals.screen.loop.start.added(cable).added(wave).added(oil)
    assert set(Beside(rivals).taken_together(model)) == {"cogging", "viscous_damping"}


def test_a_frequency_beside_a_curve_does_not_weigh_on_its_bends(screen_of):
    """Its derivative grows with time: a thousand times those of the curve's heights."""
    floor = Term(library()["floor_vibration"], (0.5, 56.2, 2.7))

    @unlisted(SIZE, over="")
    def both(ports, p):
        floor.effect.apply(ports, floor.mapping())
        splinter.apply(ports, {"size": 3.0})

    screen = screen_of(both, size=1.0)
    linear = screen.linear(screen.loop.start.added(floor))
    coordinate = Coordinate("position", "position", step=2.5e-4)
    beside = screen.curve(coordinate, linear)
    fixed = screen.curve(coordinate, replace(linear, effects=linear.effects[:, :0]))
    assert beside.prediction.energy < 1.1 * fixed.prediction.energy


def test_what_the_shape_of_a_name_lacks_is_no_other_effect(screen_of):
    """Beside a bump in the shape of a tent a bell leaves what a level of friction takes up."""

    @unlisted(SIZE, over="")
    def tent(ports, p):
        away = np.abs(ports.positions + 0.005) / 0.03
        ports.scale_position_coulomb(1.0 + p["size"] * np.maximum(1.0 - away, 0.0))

    bell = Term(library()["friction_position"], (0.45, -0.005, 0.0138))
    level = Term(library()["coulomb_level"], (1.01,))
    rivals = find_rivals(screen_of(tent, size=0.5))
    start = rivals.screen.loop.start
    assert rivals.leave_names([start.added(bell)], leaves_structure=False)
    assert "coulomb_level" in Beside(rivals).doubts(start.added(bell).added(level))[0]


def test_a_small_effect_that_no_curve_predicts_keeps_its_name(screen_of):
    dirt_and_oil = {"friction_position": (0.45, -0.005, 0.0138), "viscous_damping": (1.1,)}
    terms = [Term(library()[name], values) for name, values in dirt_and_oil.items()]

    @unlisted(SIZE, over="")
    def both(ports, p):
        for term in terms:
            keys = [parameter.key for parameter in term.effect.parameters]
            term.effect.apply(ports, dict(zip(keys, term.values, strict=True)))

    rivals = find_rivals(screen_of(both, size=1.0))
    model = rivals.screen.loop.start.added(terms[0]).added(terms[1])
    assert Beside(rivals).doubts(model) == ((), ())


def test_names_stay_where_no_curve_adds_anything(screen_of):
    effect, values = library()["cogging"], (1.5, 0.03, 0.0)
    screen = screen_of(effect, amplitude=1.5, pitch=0.03, phase=0.0)
    model = screen.loop.start.added(Term(effect, values))
    assert Beside(find_rivals(screen)).doubts(model) == ((), ())
