"""Which coordinate a force depends on, and when library effects keep their names."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from hil_sim.effects.library import library
from hil_sim.plant import simulate
from sim2real.blind.unlisted_effects import unlisted
from sim2real.fitting import NUISANCES, AxisModel, Term
from sim2real.gap import prepare_replay
from sim2real.rivals import describe_force, find_rivals
from sim2real.rivals.coordinates import Coordinate, stop_operators
from sim2real.rivals.decision import count_shown, find_period, harmonics
from sim2real.rivals.screen import Curve
from tests.unit.sim2real.rivals.conftest import rivals_of
from tests.unit.sim2real.rivals.forces import (
    SIZE,
    dead_band,
    dirt,
    drag,
    easing,
    eddies,
    magnet,
    pulse,
    running_up,
    slow_pulse,
    splinter,
)


@pytest.mark.parametrize(
    ("effect", "size", "over"),
    [
        (drag, 60.0, "velocity"),
        (eddies, 3.0, "velocity"),
        (dead_band, 1.2, "force"),
        (magnet, 1.2, "reversal_path"),
        (splinter, 3.0, "position"),
        (dirt, 0.8, "position_direction"),
        (easing, 0.4, "time"),
        (pulse, 0.2, "time"),
        (slow_pulse, 0.2, "time"),
        (running_up, 0.8, "time"),
    ],
    ids=lambda value: getattr(value, "name", None),
)
def test_the_coordinate_of_a_force_on_no_list_is_found(screen_of, effect, size, over):
    screen = screen_of(effect, size=size)
    rivals = find_rivals(screen)
    (found,) = rivals.unlisted("x")
    assert (found.axis, found.over, found.alike) == ("x", over, ())
    assert found.gap_closed > 0.85
    assert found.probability > 0.5
    offset = screen.loop.start.added(Term(library()["force_offset"], (0.5,)))
    assert not rivals.leave_names([offset])
    at, force = np.array(found.curve.at), np.array(found.curve.force)
    if effect in (splinter, dirt):
        assert abs(at[np.argmax(np.abs(force))] + 0.01) < 3e-4
        bends = np.abs(np.diff(force, 2))
        away = np.abs(at[1:-1] + 0.01) > 3e-3
        assert np.sqrt(np.mean(bends[away] ** 2)) < 0.02 * bends.max(), "straight elsewhere"
    if effect is drag:
        fast = np.abs(at) > 0.3 * at.max()
        np.testing.assert_allclose(force[fast], size * (at * np.abs(at))[fast], rtol=0.2)


@pytest.mark.parametrize("width", [1e-5, 4e-7])
def test_an_encoder_that_lags_behind_the_path_is_no_friction(screen_of, width):
    """What its mount gives way to grows over 20 um after a reversal; with play it is at once."""

    def read(position):
        return position - 1e-6 * stop_operators(position, np.array([width]))[:, 0]

    rivals = find_rivals(screen_of(read=read))
    (found,) = rivals.unlisted("x")
    assert (found.over, found.times, found.alike) == ("reversal_path", "reading", ())
    assert found.what == "an error of the encoder"
    assert found.gap_closed > 0.75
    error = found.curve.force
    assert (error[0], error[-1]) == pytest.approx((1e-6, -1e-6), rel=0.5)
    assert describe_force(rivals.screen.loop, [found]) == (), "no twin has it"
    stiff = rivals.screen.loop.start.added(Term(library()["presliding_stiffness"], (1.05,)))
    assert not rivals.leave_names([stiff])


def test_friction_that_grows_with_acceleration_has_its_coordinate(screen_of):
    @unlisted(SIZE, over="")
    def pressed(ports, p):
        ports.press(p["size"], 0.4)

    (found,) = find_rivals(screen_of(pressed, size=0.2)).unlisted("x")
    assert (found.over, found.times) == ("acceleration", "friction")
    assert set(found.alike) <= {"force"}
    assert found.gap_closed > 0.9
    at, force = np.array(found.curve.at), np.array(found.curve.force)
    assert force[np.abs(at) > 2.5].min() > 1.5


def test_iron_that_lags_behind_the_motor_force_is_no_set_of_effects(screen_of, nominal):
    recording, settings = nominal
    replay = prepare_replay(recording, settings)
    force = simulate(settings, replay.demand, replay.offset, seed=3).force[:, 0]
    behind = 5.0 * stop_operators(force, np.array([5.0]))[:, 0]
    times = settings.sync_period * np.arange(len(behind))

    @unlisted(SIZE, over="")
    def iron(ports, p):
        ports.add_time_force(p["size"] * np.interp(ports.times, times, behind))

    rivals = find_rivals(screen_of(iron, size=0.15))
    (found,) = rivals.unlisted("x")
    assert (found.over, found.times, found.alike) == ("force", "history", ())
    assert found.gap_closed > 0.85
    reversal = np.interp((2.0, 10.0, 25.0), found.curve.at, found.curve.force)
    assert np.diff(reversal) == pytest.approx((8.0 * 0.15, 0.0), abs=0.25), "loop of 10 N"
    twin = describe_force(rivals.screen.loop, [found])[0].force
    since = np.array([[2.0], [10.0], [25.0]])
    lost = np.clip(since / np.array(twin.turned) - 1.0, -1.0, 1.0) @ np.array(twin.lagging)
    assert np.diff(lost) == pytest.approx((8.0 * 0.15, 0.0), abs=0.25)
    assert not any((*twin.always, *twin.against, *twin.over_velocity))


WAVES = (6.0, 6.0, -6.0, -6.0)


@pytest.mark.parametrize(("lost", "wavers"), [(0.01, 0.0), (0.01, 1.0), (0.03, 0.0)])
def test_a_near_shape_keeps_its_name_only_where_it_leaves_no_structure(nominal, lost, wavers):
    """A name that loses a hundredth of the gap, for certain or not, and one that loses more."""
    moves, gap = 20, 1e4
    rivals = rivals_of(nominal, gap, lost * (1.0 + wavers * np.resize(WAVES, moves)))
    one = AxisModel(np.zeros(NUISANCES), (Term(library()["viscous_damping"], (1.5,)),))
    assert rivals.leave_names([one]) is (lost < 0.02)
    assert rivals.leave_names([one], leaves_structure=True) is (wavers > 0.0)


VALUES = {
    "coulomb_level": (1.2,),
    "thermal_drift": (0.2, 30.0),
    "force_constant": (1.05,),
    "viscous_damping": (1.5,),
}


@pytest.mark.parametrize(
    ("names", "errors", "complete"),
    [
        (("coulomb_level", "viscous_damping"), 0.5, False),
        (("coulomb_level", "viscous_damping"), 2.0, True),
        (("coulomb_level", "viscous_damping"), 4.0, True),
        (("force_constant", "viscous_damping"), 0.0, True),
        (("force_constant", "viscous_damping"), -1.0, False),
        (("coulomb_level", "thermal_drift"), 2.0, False),
        (("coulomb_level", "thermal_drift"), 4e4, True),
    ],
)
def test_a_complete_set_has_to_predict_as_well_as_a_curve(nominal, names, errors, complete):
    """It has fewer figures. Levels of friction have to do more: innovations do not show them."""
    moves = 40
    swings = np.resize(WAVES, moves)
    blocks = swings.reshape(-1, 2).sum(axis=1)
    error = blocks.std(ddof=1) * np.sqrt(len(blocks))
    rivals = rivals_of(nominal, 1e4, 1e-5 * (swings - errors * error / moves))
    terms = tuple(Term(library()[name], VALUES[name]) for name in names)
    both = AxisModel(np.zeros(NUISANCES), terms)
    assert rivals.leave_names([both], is_complete=True) is complete
    if "thermal_drift" not in names:
        assert rivals.leave_names([both]) is (errors > 3.0)


@pytest.mark.parametrize(("worse", "kept"), [(0.05, False), (0.5, True)])
def test_a_bump_beside_a_level_is_a_slope_where_few_nodes_do_as_well(nominal, worse, kept):
    """By less than what matters anywhere the names predict better, however certain that is."""
    moves = 20
    rivals = rivals_of(nominal, 1e4, -1e-3 * (1.0 + 0.02 * np.resize(WAVES, moves)))
    names = rivals.screen.model(None)
    few = replace(names, energies=names.energies + worse * 100.0)
    (best,) = rivals.curves
    best = replace(best, coordinate=Coordinate("position_direction", "position", "friction"))
    rivals.screen.curve = lambda _: replace(best, prediction=few)
    bump, level = (library()[name] for name in ("friction_position", "coulomb_level"))
    terms = (Term(bump, (0.3, 0.05, 0.05)), Term(level, (0.85,)))
    model = AxisModel(np.zeros(NUISANCES), terms)
    assert replace(rivals, curves=[best]).leave_names([model], is_complete=True) is kept


@pytest.mark.parametrize(("pitch", "comes_back"), [(0.03, True), (0.08, False)])
def test_a_wave_longer_than_the_motion_is_any_curve(nominal, pitch, comes_back):
    """Beside a spring it imitates a hose that becomes taut half way along the travel."""
    rivals = rivals_of(nominal, 1e4, 1e-5 * np.resize(WAVES, 40))
    spring, wave = (library()[name] for name in ("cable_stiffness", "cogging"))
    terms = (Term(spring, (20.0, -0.03)), Term(wave, (0.3, pitch, 0.0)))
    model = AxisModel(np.zeros(NUISANCES), terms)
    assert rivals.leave_names([model], is_complete=True) is comes_back
    assert rivals.shapes(model) == ([] if comes_back else ["cogging"])
    assert rivals.shapes(model.without(0)) == [], "alone it may be a wave"


@pytest.mark.parametrize(
    ("force", "period"),
    [
        (lambda x: np.sin(x / 0.004 + 1.0) + 0.5 * np.sin(3.0 * x / 0.004), 0.004 * 2.0 * np.pi),
        (lambda x: np.sin(x / 0.0016) + 0.01 * x, 0.0016 * 2.0 * np.pi),  # no multiple of it
        (lambda x: np.sin(x / 0.01), 0.0),  # seen less than twice
        (lambda x: 40.0 * x + np.exp(-((x / 0.002) ** 2)), 0.0),
        (lambda x: np.tanh((x - 0.01) / 0.003), 0.0),
        (lambda x: np.random.default_rng(1).standard_normal(len(x)).cumsum(), 0.0),
        (lambda x: 0.0 * x, 0.0),
    ],
)
def test_only_a_curve_that_has_been_seen_twice_repeats_itself(force, period):
    at = np.linspace(-0.05, 0.04, 91)
    curve = Curve(Coordinate("position", "position"), at, force(at), 0.0 * at, None)
    assert find_period(curve) == pytest.approx(period, rel=0.01)


@pytest.mark.parametrize(
    ("ratio", "tuned"), [(2.01, True), (2.98, True), (2.2, False), (5.0, False)]
)
def test_a_wave_of_half_or_a_third_of_a_pitch_is_a_harmonic(ratio, tuned):
    waves = {"cogging": 0.028, "transmission_ripple": 0.028 / ratio}
    known = library()
    terms = tuple(Term(known[name], (1.0, pitch, 0.5)) for name, pitch in waves.items())
    model = AxisModel(np.zeros(NUISANCES), (*terms, Term(known["viscous_damping"], (1.2,))))
    assert harmonics(model) == (["transmission_ripple"] if tuned else [])


def test_a_library_effect_keeps_its_name(screen_of):
    effect, values = library()["viscous_damping"], (1.8,)
    screen = screen_of(effect, ratio=1.8)
    rivals = find_rivals(screen)
    assert rivals.curves[0].coordinate.over == "velocity"
    model = screen.loop.start.added(Term(effect, values))
    assert rivals.leave_names([model])
    assert rivals.leave_names([model], leaves_structure=True)


def test_what_does_not_show_along_the_motion_is_not_one_of_several(screen_of):
    cogging, mass = library()["cogging"], Term(library()["payload_mass"], (0.1,))
    screen = screen_of(cogging, amplitude=1.5, pitch=0.03, phase=0.0)
    model = screen.loop.start.added(Term(cogging, (1.5, 0.03, 0.0))).added(mass)
    prediction = screen.model(model)
    assert count_shown(screen, model, prediction, 0.02 * prediction.energy) == 1


def test_several_effects_of_one_coordinate_are_one_curve(screen_of):
    """A level and a fading one are a function of time that no single effect has."""

    @unlisted(SIZE, over="")
    def two_stages(ports, p):
        for constant in (1.2, 95.0):
            ports.decay_coulomb(0.5 * p["size"], constant)

    screen = screen_of(two_stages, size=0.4)
    level = Term(library()["coulomb_level"], (1.19,))
    fading = Term(library()["thermal_drift"], (0.2, 1.2))
    rivals = find_rivals(screen)
    assert rivals.unlisted("x")[0].over == "time"
    assert not rivals.leave_names([screen.loop.start.added(level).added(fading)])


def test_a_complete_set_of_which_one_shows_along_the_motion_keeps_its_names(screen_of):
    """What acts within the control loop cannot be a part of the curve."""
    screen = screen_of(easing, size=0.4)
    level = Term(library()["coulomb_level"], (1.15,))
    lag = Term(library()["current_bandwidth"], (200.0,))
    model = screen.loop.start.added(level).added(lag)
    rivals = find_rivals(screen)
    assert rivals.leave_names([model], is_complete=True)
    assert not rivals.leave_names([model])


def test_without_a_gap_there_is_no_coordinate(screen_of):
    assert find_rivals(screen_of()).unlisted("x") == ()


@pytest.mark.parametrize(("gap", "shown"), [(1e3, True), (150.0, False)])
def test_a_curve_that_closes_a_third_is_shown_where_the_gap_is_large(nominal, gap, shown):
    moves = 20
    rivals = rivals_of(nominal, gap, np.full(moves, 1.0))
    (curve,) = rivals.curves
    energies = curve.prediction.energies + 0.67 * gap
    weak = replace(curve, prediction=replace(curve.prediction, energies=energies))
    rivals = replace(rivals, curves=[weak])
    rivals.screen.blocks = np.repeat(np.arange(moves), 50)
    assert rivals.leave_names([])
    found = rivals.unlisted("x")
    assert [(each.over, round(each.gap_closed, 2)) for each in found] == (
        [("velocity", 0.33)] if shown else []
    )
    assert all(each.probability < 0.34 for each in found)


def test_an_axis_that_hardly_moves_has_no_curves():
    rivals = find_rivals(SimpleNamespace(samples=10.0))
    assert rivals.leave_names([])
    assert rivals.unlisted("x") == ()
