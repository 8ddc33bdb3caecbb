"""Which coordinate a force depends on, and when library effects keep their names."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from hil_sim.effects import Parameter
from hil_sim.effects.library import library
from hil_sim.plant import simulate
from sim2real.blind.unlisted_effects import unlisted
from sim2real.fitting import NUISANCES, AxisModel, Term
from sim2real.gap import prepare_replay
from sim2real.open_loop import MotionLoop, measure_motion
from sim2real.rivals import Beside, Screen, describe_force, find_rivals
from sim2real.rivals.coordinates import Coordinate, stop_operators
from sim2real.rivals.decision import Rivals, count_shown, find_period, harmonics
from sim2real.rivals.grouped_fit import Prediction
from sim2real.rivals.screen import Curve
from tests.unit.sim2real.conftest import TOLERANCE

SIZE = Parameter("size", "", "", (0.0, 1.0), neutral=0.0)


@unlisted(SIZE, over="")
def drag(ports, p):
    ports.add_velocity_force(p["size"] * ports.velocities * np.abs(ports.velocities))


@unlisted(SIZE, over="")
def eddies(ports, p):
    speed = ports.velocities / 0.04
    ports.add_velocity_force(2.0 * p["size"] * speed / (1.0 + speed**2))


@unlisted(SIZE, over="")
def dead_band(ports, p):
    ports.lose_motor_force(np.clip(ports.motor_forces, -p["size"], p["size"]))


@unlisted(SIZE, over="")
def square_loss(ports, p):
    ports.lose_motor_force(p["size"] * ports.motor_forces * np.abs(ports.motor_forces))


@unlisted(SIZE, over="")
def magnet(ports, p):
    for length in (5e-4, 2e-3, 8e-3):
        ports.add_hysteresis(p["size"] / 3.0, p["size"] / 3.0 / length)


@unlisted(SIZE, over="")
def splinter(ports, p):
    away = (ports.positions + 0.01) / 6e-4
    ports.add_position_force(p["size"] * np.exp(-0.5 * away**2))


@unlisted(SIZE, over="")
def dirt(ports, p):
    away = (ports.positions + 0.01) / 6e-4
    ports.scale_position_coulomb(1.0 + p["size"] * np.exp(-0.5 * away**2))


@unlisted(SIZE, over="")
def pulse(ports, p):
    ports.scale_time_coulomb(1.0 + p["size"] * np.sin(2.0 * np.pi * 1.3 * ports.times + 0.4))


@unlisted(SIZE, over="")
def slow_pulse(ports, p):
    ports.scale_time_coulomb(1.0 + p["size"] * np.sin(2.0 * np.pi * 0.4 * ports.times + 0.4))


@unlisted(SIZE, over="")
def running_up(ports, p):
    cycles = 15.0 * ports.times + 2.0 * ports.times**2
    ports.add_time_force(p["size"] * np.sin(2.0 * np.pi * cycles))


@unlisted(SIZE, over="")
def easing(ports, p):
    ports.scale_time_coulomb(1.0 + p["size"] * np.exp(-ports.times / 3.0))


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


@pytest.mark.parametrize(("lost", "wavers"), [(0.01, 0.0), (0.01, 1.0), (0.03, 0.0)])
def test_a_near_shape_keeps_its_name_only_where_it_leaves_no_structure(nominal, lost, wavers):
    """A name that loses a hundredth of the gap, for certain or not, and one that loses more."""
    moves, gap = 20, 1e4
    rivals = rivals_of(nominal, gap, lost * (1.0 + wavers * np.resize(WAVES, moves)))
    one = AxisModel(np.zeros(NUISANCES), (Term(library()["viscous_damping"], (1.5,)),))
    assert rivals.leave_names([one]) is (lost < 0.02)
    assert rivals.leave_names([one], leaves_structure=True) is (wavers > 0.0)


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


COGGING_AND_OIL = {"cogging": (1.5, 0.03, 0.0), "viscous_damping": (1.5,)}
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


def test_a_loss_goes_on_straight_beyond_the_forces_recorded(screen_of):
    screen = screen_of(square_loss, size=0.004)
    force = describe_force(screen.loop, find_rivals(screen).unlisted("x"))[0].force
    slopes = np.diff(force.lost) / np.diff(force.motor_force)
    assert (slopes[0], slopes[-1]) == pytest.approx((slopes[1], slopes[-2]))
    _, highest = screen.extent("force")
    assert force.motor_force[-1] > 1.2 * highest


def test_the_simplest_description_is_the_known_coordinate_alone(screen_of):
    """Curves over others follow what is this recording's own, such as the wander of friction."""
    screen = screen_of(splinter, size=3.0)
    simplest, *others = (
        each.force for each in describe_force(screen.loop, find_rivals(screen).unlisted("x"))
    )
    assert max(simplest.always) == pytest.approx(3.0, rel=0.15)
    assert set(simplest.coulomb) == {1.0}
    assert not any(simplest.over_velocity)
    assert all(set(force.coulomb) != {1.0} for force in others)


def test_a_coordinate_that_closes_little_does_not_say_where_nodes_lie(screen_of):
    """Nodes as close as its own follow what belongs to the places where the axis came to rest."""
    screen = screen_of(drag, size=300.0)
    (found,) = find_rivals(screen_of(splinter, size=3.0)).unlisted("x")
    fine, *_ = describe_force(screen.loop, [found])
    coarse = describe_force(screen.loop, [replace(found, gap_closed=0.3)])
    assert coarse
    assert all(len(each.force.position) < 15 < len(fine.force.position) for each in coarse)


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
