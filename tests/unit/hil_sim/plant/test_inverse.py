"""The force along a known motion, against the simulator that made the motion."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from hil_sim.plant import force_along, force_variants, simulate

RATE, FINE = 1e3, 1e-4
MIDDLE = slice(800, 3200)


def demand():
    """Strokes of both axes that begin and end smoothly, sampled at every control tick [m]."""
    t = np.arange(0.0, 4.0, FINE)
    ramp = np.minimum(1.0, t / 0.5)[:, None] ** 3
    x = 0.05 * np.sin(2 * np.pi * 0.5 * t) ** 3 + 0.01 * np.sin(2 * np.pi * 1.3 * t) ** 2
    return ramp * np.column_stack([x, 0.03 * np.sin(2 * np.pi * 0.8 * t)])


def smooth(values, cutoff, rate):
    return sosfiltfilt(butter(4, 2.0 * cutoff / rate, output="sos"), values, axis=0)


def motion_and_force(stage):
    """What the simulator does, every millisecond: its motion, and its force."""
    made = simulate(
        replace(stage, sync_period=FINE), demand(), np.zeros_like(demand()), None, rounded=False
    )
    position = smooth(smooth(made.position, 200.0, 1.0 / FINE)[::10], 120.0, RATE)
    velocity = np.gradient(position, 1.0 / RATE, axis=0)
    acceleration = np.zeros_like(position)
    acceleration[1:-1] = np.diff(position, 2, axis=0) * RATE**2
    return (position, velocity, acceleration), smooth(made.force, 200.0, 1.0 / FINE)[::10]


def left(force, stage, motion):
    """Rms of what the inverse leaves of the force of axis 0, below 50 Hz [N]."""
    difference = smooth(force - force_along(stage, motion), 50.0, RATE)
    return float(np.std(difference[MIDDLE, 0]))


@pytest.mark.parametrize(
    ("name", "values", "closes"),
    [
        ("force_ripple", {"ratio": 0.06, "pitch": 0.011, "phase": 1.0}, 30.0),
        ("cable_hysteresis", {"force": 1.0, "stiffness": 2500.0}, 30.0),
        ("base_motion", {"frequency": 10.0, "damping": 0.1, "mass_ratio": 0.04}, 10.0),
        ("cross_coupling", {"mass": 0.3}, 10.0),
        ("thermal_drift", {"amplitude": 0.3, "time_constant": 5.0}, 30.0),
        ("friction_position", {"amplitude": 0.5, "center": 0.01, "width": 0.01}, 30.0),
        ("force_saturation", {"force": 70.0}, 8.0),
        ("load_friction", {"ratio": 0.2, "motor_share": 0.3}, 30.0),
    ],
)
def test_an_effect_takes_the_force_that_the_simulator_needed(
    nominal, with_effects, effects, name, values, closes
):
    stage = with_effects(nominal, effects[name].at(**values))
    motion, force = motion_and_force(stage)
    assert left(force, nominal, motion) > closes * left(force, stage, motion)


def test_the_plain_stage_is_exact_to_a_thousandth(nominal):
    motion, force = motion_and_force(nominal)
    assert left(force, nominal, motion) < 1e-3 * np.std(force[MIDDLE, 0])


def test_dead_time_lies_before_the_reported_force(nominal, with_effects, effects):
    stage = with_effects(nominal, effects["dead_time"].at(delay=5e-4))
    motion, _ = motion_and_force(nominal)
    assert np.array_equal(force_along(stage, motion), force_along(nominal, motion))


def test_oscillators_faster_than_the_samples_are_followed(nominal, with_effects, effects):
    """At 100 Hz a joint of 90 Hz has settled at every sample: both parts accelerate alike."""
    joint = effects["resonance"].at(frequency=90.0, damping=0.03, mass_ratio=0.2)
    slow = replace(with_effects(nominal, joint), sync_period=0.01)
    t = np.arange(0.0, 4.0, 0.01)
    rate = 2.0 * np.pi * 1.5
    course = [0.02 * rate**n * np.sin(rate * t + n * np.pi / 2.0) for n in range(3)]
    motion = tuple(np.column_stack([part] * 2) for part in course)
    rigid = force_along(replace(nominal, sync_period=0.01), motion)
    difference = (force_along(slow, motion) - rigid)[200:, 0]
    assert np.abs(difference).max() < 0.02 * np.abs(rigid[200:, 0]).max()


def test_variants_are_axes_side_by_side(nominal, with_effects, effects):
    stage = with_effects(nominal, effects["force_offset"].at(force=2.0))
    whole, _ = motion_and_force(nominal)
    own = tuple(part[:, 0] for part in whole)
    both = force_variants(nominal.sync_period, [nominal.axes[0], stage.axes[0]], own)
    assert both[:, 0] == pytest.approx(force_along(nominal, whole)[:, 0], abs=1e-12)
    assert both[:, 1] - both[:, 0] == pytest.approx(np.full(len(both), 2.0))


def test_variants_may_have_motions_of_their_own(nominal):
    (whole, _), axis = motion_and_force(nominal), nominal.axes[0]
    one = tuple(part[:, 0] for part in whole)
    other = one[0] + 1e-6, *one[1:]
    each = tuple(map(np.column_stack, zip(one, other, strict=True)))
    both = force_variants(nominal.sync_period, [axis, axis], each)
    for number, own in enumerate((one, other)):
        alone = force_variants(nominal.sync_period, [axis], own)
        assert both[:, number] == pytest.approx(alone[:, 0], abs=1e-12)


def test_what_goes_with_position_goes_on_beyond_the_travel(nominal, with_effects, effects):
    """A log may reach farther than the one that the machine file's travel came from."""
    stage = with_effects(nominal, effects["cogging"].at(amplitude=2.0, pitch=0.07, phase=0.3))
    farther = np.linspace(-0.5, 0.5, 400)[:, None] * np.ones(2)
    motion = farther, np.full_like(farther, 0.1), np.zeros_like(farther)
    taken = (force_along(stage, motion) - force_along(nominal, motion))[:, 0]
    expected = 2.0 * np.sin(2.0 * np.pi * farther[:, 0] / 0.07 + 0.3)
    assert taken == pytest.approx(expected, abs=0.05)
    assert stage.reaching(0.1 * farther) is stage


def test_motions_of_other_shapes_are_refused(nominal):
    with pytest.raises(ValueError, match="must have shape"):
        force_along(nominal, (np.zeros(5), np.zeros(5), np.zeros(5)))
    with pytest.raises(ValueError, match="velocity"):
        force_along(nominal, (np.zeros((5, 2)), np.zeros((4, 2)), np.zeros((5, 2))))


def test_variants_that_involve_the_other_axis_are_refused(nominal, with_effects, effects):
    stage = with_effects(nominal, effects["cross_coupling"].at(mass=0.3))
    rest = (np.zeros(5), np.zeros(5), np.zeros(5))
    with pytest.raises(ValueError, match="involves another axis"):
        force_variants(nominal.sync_period, [nominal.axes[0], stage.axes[0]], rest)
