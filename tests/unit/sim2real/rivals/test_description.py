"""What no effect explains, described."""

from dataclasses import replace

import numpy as np
import pytest

from hil_sim.effects.residual_table import ResidualTable
from sim2real.findings import ForceCurve, Unlisted, finding_json
from sim2real.gap import prepare_replay
from sim2real.open_loop import MotionLoop, compare_along, measure_motion
from sim2real.rivals import describe_force, find_rivals
from tests.unit.sim2real.open_loop.test_motion import imported
from tests.unit.sim2real.other_machines import TOOL, sliding, strokes
from tests.unit.sim2real.rivals.forces import drag, splinter, square_loss

KNOWN = ("300", "250", "400")


def odd(t, x, v, a):
    """A force that no effect of the library has, beside the known machine's."""
    over_place = 60.0 * np.cos(2.0 * np.pi * x / 0.4) + 40.0 * np.sign(v) * (x > 0.2) * (x - 0.2)
    return TOOL.force(t, x, v, a) - 80.0 + over_place + 900.0 * v * np.abs(v)


def described(machine, folder):
    recording, stage = imported(machine, folder)
    return description(measure_motion(recording, stage), stage)


def description(motion, stage, name="a", unlisted=()):
    found = describe_force(MotionLoop(name, [motion], stage, 1e-4), unlisted)
    return found[0].force if found else None


def test_a_force_of_any_smooth_shape(tmp_path):
    found = described(replace(TOOL, force=odd, known=KNOWN), tmp_path)
    assert found.gap_closed > 0.9
    place = np.array(found.position)
    always = np.array(found.always)
    expected = 60.0 * np.cos(2.0 * np.pi * place / 0.4)
    assert np.std((always - expected)[1:-1]) < 0.25 * np.std(expected)
    assert found.over_velocity[0] < 0.0 < found.over_velocity[-1]
    assert found.over_velocity[len(found.over_velocity) // 2] == 0.0
    assert len(found.velocity) == len(found.over_velocity)


def test_it_goes_on_straight_beyond_the_speeds_recorded(tmp_path):
    found = described(replace(TOOL, force=odd, known=KNOWN), tmp_path)
    slopes = np.diff(found.over_velocity) / np.diff(found.velocity)
    assert slopes[0] == pytest.approx(slopes[1])
    assert slopes[-1] == pytest.approx(slopes[-2])
    assert found.velocity[-1] > 1.05 * found.velocity[-2]


@pytest.mark.parametrize(
    ("over", "times", "seen_in"),
    [
        ("time", "", ""),
        ("frequency", "", ""),
        ("acceleration", "", ""),
        ("other_axis", "", ""),
        ("time", "friction", ""),
        ("position", "", "innovations"),
    ],
)
def test_what_no_twin_can_have_is_not_described(tmp_path, over, times, seen_in):
    recording, stage = imported(replace(TOOL, force=odd, known=KNOWN), tmp_path)
    curve = ForceCurve((0.0, 1.0), (0.0, 1.0), (0.1, 0.1))
    unlisted = Unlisted("a", over, (), 0.9, 0.9, (0.8, 1.0), curve, times, seen_in)
    assert description(measure_motion(recording, stage), stage, "a", [unlisted]) is None


def test_an_encoder_that_misreads_is_described_by_its_error(tmp_path):
    plain = replace(TOOL, force=lambda *args: TOOL.force(*args) - 80.0, known=KNOWN, rate=500.0)
    recording, stage = imported(plain, tmp_path)
    signals = recording.axes["a"]

    def error(x):
        return 4e-4 * np.sin(2.0 * np.pi * x / 0.1)

    read = signals.position_actual + error(signals.position_actual)
    recording = replace(recording, axes={"a": replace(signals, position_actual=read)})
    nodes = tuple(np.arange(0.0, 0.4, 0.01).tolist())
    curve = ForceCurve(nodes, nodes, nodes)
    unlisted = Unlisted("a", "position", (), 0.9, 0.9, (0.8, 1.0), curve, "reading")
    found = description(measure_motion(recording, stage), stage, "a", [unlisted])
    assert found.gap_closed > 0.9
    assert not any((*found.always, *found.against, *found.over_velocity))
    bent = np.diff(found.misread, 2)
    assert np.corrcoef(np.diff(error(np.array(found.reading)), 2), bent)[0, 1] > 0.9


def test_a_motor_that_is_weak_in_places_is_described_by_its_gain(tmp_path):
    def gain(x):
        return 1.0 - 0.15 * np.exp(-0.5 * ((x - 0.2) / 0.06) ** 2)

    def weak(t, x, v, a):
        return (TOOL.force(t, x, v, a) - 80.0) / gain(x)

    recording, stage = imported(replace(TOOL, force=weak, known=KNOWN), tmp_path)
    nodes = tuple(np.arange(0.0, 0.4, 0.02).tolist())
    unlisted = Unlisted(
        "a", "position", (), 0.9, 0.9, (0.8, 1.0), ForceCurve(nodes, nodes, nodes), "force"
    )
    found = description(measure_motion(recording, stage), stage, "a", [unlisted])
    assert found.gap_closed > 0.9
    assert found.gain == pytest.approx(gain(np.array(found.gain_at)), abs=0.03)


def test_noise_is_not_described(tmp_path):
    plain = replace(TOOL, force=lambda *args: TOOL.force(*args) - 80.0, known=KNOWN)
    assert described(plain, tmp_path) is None


def test_forces_that_change_within_a_period_are_not_described(nominal):
    recording, stage = nominal  # accelerates at the same places again and again
    motion = measure_motion(recording, stage)
    along = compare_along(motion, stage)
    floor = along.floor.rms["x"]["force"]
    assert np.std(along.residual["x"]["force"][motion.axes["x"].usable]) > 5.0 * floor
    for name in ("x", "y"):
        assert description(motion, stage, name) is None


def test_it_is_a_table_beside_the_model(tmp_path):
    found = described(replace(TOOL, force=odd, known=KNOWN), tmp_path)
    coulomb = 250.0
    assert found.coulomb == pytest.approx(
        np.maximum(1.0 + np.array(found.against) / coulomb, 0.0), rel=1e-6
    )
    assert found.table()["force"] == found.always


@pytest.mark.parametrize(
    "key", ["position", "always", "against", "coulomb", "velocity", "over_velocity"]
)
def test_it_is_plain_json(tmp_path, key):
    found = finding_json(described(replace(TOOL, force=odd, known=KNOWN), tmp_path))
    assert all(isinstance(value, float) for value in found[key])


def closed_by_twin(motion, stage, found):
    """The share of the gap above the floor that the table closes in the model."""
    axis = stage.axes[0]
    twin = replace(stage, axes=(replace(axis, effects=(ResidualTable().at(**found.table()),)),))
    used = motion.axes["a"].usable
    before, after = (compare_along(motion, model) for model in (stage, twin))
    floor = before.floor.rms["a"]["force"] ** 2
    left = [np.mean(m.residual["a"]["force"][used] ** 2) - floor for m in (before, after)]
    return 1.0 - left[1] / left[0]


@pytest.mark.parametrize("coulomb", [250.0, 20.0, 1e-3])
def test_what_is_claimed_is_what_the_twin_closes(tmp_path, coulomb):
    """A guide that grips, on a model with friction, with too much of it, and with hardly any."""

    def grips(t, x, v, a):
        level = 40.0 + 160.0 * (1.0 + np.cos(2.0 * np.pi * x / 0.4)) / 2.0
        return 300.0 * a + sliding(v, level, 400.0) + 60.0 * np.cos(2.0 * np.pi * x / 0.4)

    recording, stage = imported(replace(TOOL, force=grips, known=KNOWN), tmp_path)
    axis = replace(stage.axes[0], friction=replace(stage.axes[0].friction, coulomb=coulomb))
    stage = replace(stage, axes=(axis,))
    motion = measure_motion(recording, stage)
    tried = [each.force for each in describe_force(MotionLoop("a", [motion], stage, 1e-4))]
    most = max(force.gap_closed for force in tried)
    found = next(force for force in tried if force.gap_closed > most - 0.01)
    assert found.gap_closed == pytest.approx(closed_by_twin(motion, stage, found), abs=0.03)
    assert max(found.coulomb) * coulomb < 300.0
    if coulomb < 1.0:
        assert set(found.coulomb) == {1.0}


def test_the_simulator_takes_the_table_of_a_light_and_slow_axis(tmp_path):
    """10 g at 1 mm/s: friction of 5 mN that doubles at the lowest velocities, not in the model."""

    def sticks(t, x, v, a):
        return 300.0 * a + sliding(v, 45e3, 0.0) * (1.0 + np.exp(-np.abs(v) / 0.01))

    motion = strokes(0.1, (0.006, 0.05, 0.3), 1.0)
    machine = replace(TOOL, motion=motion, force=sticks, known=KNOWN, rated=2e4, duration=120.0)
    recording, stage = imported(machine, tmp_path)
    length, mass = 1.0 / 300.0, 0.01 / 300.0
    logged = recording.axes["a"]
    logged = replace(
        logged,
        position_demand=length * logged.position_demand,
        position_actual=length * logged.position_actual,
        force_actual=mass * length * logged.force_actual,
    )
    recording = replace(recording, axes={"a": logged})
    axis = stage.axes[0]
    friction = replace(axis.friction, coulomb=5e-3, viscous=0.0)
    control = replace(axis.control, period=1e-4, rated_force=2e-3)
    axis = replace(axis, mass=0.01, friction=friction, control=control)
    stage = replace(stage, axes=(axis,))
    motion = measure_motion(recording, stage)
    found = description(motion, stage)
    assert found.gap_closed > 0.5
    ResidualTable().check(found.table(), axis)


def test_an_axis_that_moves_in_every_other_pair_of_strokes_is_described(tmp_path):
    recording, stage = imported(replace(TOOL, force=odd, known=KNOWN), tmp_path)
    motion = measure_motion(recording, stage)
    strokes_of = motion.recording.moves
    moving = np.zeros(len(motion.recording), dtype=bool)
    for number, stroke in enumerate(strokes_of):
        moving[stroke.start : stroke.end] = number // 2 % 2 == 0
    own, logged = motion.axes["a"], motion.recording.axes["a"]
    usable = own.usable & moving
    motion = replace(
        motion,
        axes={"a": replace(own, usable=usable)},
        recording=replace(motion.recording, axes={"a": replace(logged, valid=usable)}),
    )
    found = description(motion, stage)
    assert found.gap_closed > 0.8


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


def test_drag_of_strokes_one_way_is_described_both_ways(screen_of, nominal):
    x = prepare_replay(*nominal).demand
    moved = np.cumsum(np.abs(np.diff(x[:, 0], prepend=x[0, 0])))
    one_way = np.column_stack((0.1 * moved / moved[-1] - 0.05, x[:, 1]))
    screen = screen_of(drag, demand=one_way, size=400.0)
    force = describe_force(screen.loop, find_rivals(screen).unlisted("x"))[0].force
    at, drags = np.array(force.velocity), np.array(force.over_velocity)
    assert np.allclose(at, -at[::-1])
    assert np.allclose(drags, -drags[::-1])
    fastest = np.abs(at).max() / 1.5
    assert np.interp(-fastest, at, drags) == pytest.approx(-400.0 * fastest**2, rel=0.2)
