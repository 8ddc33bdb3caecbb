"""Effects on a free mass against closed forms and an independent integrator."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

MASS = 8.0
LAG = 1.0 / (2.0 * np.pi * 1500.0)

every_step = pytest.mark.parametrize(
    ("substeps", "accuracy"), [(50, 1e-4), (5, 1.5e-3), (1, 1.5e-3)]
)


def travelled(time, force, mass=MASS):
    """Closed form of a free mass behind the current loop."""
    early = LAG * (1.0 - np.exp(-time / LAG))
    return force / mass * (0.5 * time**2 - LAG * (time - early))


def integrated(time, acceleration, start=0.0):
    """Position of x'' = acceleration(t, x, v), an independent integration to 1e-10."""
    solution = solve_ivp(
        lambda t, s: (s[1], acceleration(t, s[0], s[1])), (0.0, time[-1]), (start, 0.0),
        t_eval=time, rtol=1e-10, atol=1e-14, max_step=1e-3,
    )  # fmt: skip
    return solution.y[0]


def motor(t, force):
    return force * (1.0 - math.exp(-t / LAG))


def assert_close(position, expected, accuracy):
    assert np.abs(position - expected).max() <= accuracy * np.ptp(expected)


@every_step
def test_payload_mass(free, with_effects, effects, pushed, substeps, accuracy):
    stage = with_effects(free, effects["payload_mass"].at(mass=-1.5))
    time, position, _ = pushed(stage, 4.0, substeps=substeps)
    assert_close(position, travelled(time, 4.0, MASS - 1.5), accuracy)


@every_step
def test_force_constant_moves_but_does_not_show(
    free, with_effects, effects, pushed, current, substeps, accuracy
):
    stage = with_effects(free, effects["force_constant"].at(ratio=1.08))
    time, position, force = pushed(stage, 4.0, substeps=substeps)
    assert_close(position, travelled(time, 4.0 * 1.08), accuracy)
    np.testing.assert_allclose(force, 4.0 * current(time), atol=1e-9)


@every_step
def test_current_bandwidth(free, with_effects, effects, pushed, current, substeps, accuracy):
    stage = with_effects(free, effects["current_bandwidth"].at(bandwidth=180.0))
    time, _, force = pushed(stage, 4.0, substeps=substeps, duration=0.01)
    np.testing.assert_allclose(force, 4.0 * current(time, bandwidth=180.0), atol=1e-9)


@every_step
@pytest.mark.parametrize("delay", [0.0002, 0.000537, 0.0031])
def test_dead_time(free, with_effects, effects, pushed, current, substeps, accuracy, delay):
    slow = effects["current_bandwidth"].at(bandwidth=200.0)
    stage = with_effects(free, effects["dead_time"].at(delay=delay), slow)
    time, position, force = pushed(stage, 4.0, substeps=substeps, duration=0.05)
    np.testing.assert_allclose(force, 4.0 * current(time, delay, 200.0), atol=1e-9)
    lag = 1.0 / (2.0 * np.pi * 200.0)
    since = np.maximum(time - delay, 0.0)
    expected = 0.5 / MASS * (since**2 - 2.0 * lag * (since - lag * (1.0 - np.exp(-since / lag))))
    assert_close(position, 4.0 * expected, 2 * accuracy)


@every_step
def test_force_saturation(free, with_effects, effects, pushed, current, substeps, accuracy):
    stage = with_effects(free, effects["force_saturation"].at(force=45.0))
    time, position, force = pushed(stage, 80.0, substeps=substeps)

    def acceleration(t, x, v):
        return 45.0 * math.tanh(motor(t, 80.0) / 45.0) / MASS

    assert_close(position, integrated(time, acceleration), accuracy)
    np.testing.assert_allclose(force, 80.0 * current(time), atol=1e-6)


@every_step
def test_force_ripple(free, with_effects, effects, pushed, substeps, accuracy):
    values = {"ratio": 0.08, "pitch": 9e-3, "phase": 1.1}
    stage = with_effects(free, effects["force_ripple"].at(**values))
    time, position, _ = pushed(stage, 40.0, substeps=substeps)

    def acceleration(t, x, v):
        return motor(t, 40.0) * (1.0 + 0.08 * math.sin(2.0 * math.pi * x / 9e-3 + 1.1)) / MASS

    assert position[-1] > 2 * 9e-3
    assert_close(position, integrated(time, acceleration), accuracy)


def test_from_the_controller_to_the_carriage_in_order(free, with_effects, effects, pushed, current):
    # Factor, then saturation, then ripple: at the crest of a long ripple all three are constant.
    stage = with_effects(
        free,
        effects["force_ripple"].at(ratio=0.05, pitch=10.0, phase=math.pi / 2),
        effects["force_saturation"].at(force=40.0),
        effects["force_constant"].at(ratio=1.1),
        effects["dead_time"].at(delay=0.0004),
    )
    time, position, force = pushed(stage, 60.0, duration=0.05)

    def acceleration(t, x, v):
        late = motor(max(t - 0.0004, 0.0), 60.0)
        return 40.0 * math.tanh(1.1 * late / 40.0) * 1.05 / MASS

    assert_close(position, integrated(time, acceleration), 3e-4)
    np.testing.assert_allclose(force, 60.0 * current(time, 0.0004), atol=1e-6)


@every_step
def test_cogging(free, with_effects, effects, pushed, substeps, accuracy):
    values = {"amplitude": 2.0, "pitch": 24e-3, "phase": 0.4}
    stage = with_effects(free, effects["cogging"].at(**values))
    time, position, _ = pushed(stage, 6.0, substeps=substeps, duration=0.3)

    def acceleration(t, x, v):
        pull = 2.0 * math.sin(2.0 * math.pi * x / 24e-3 + 0.4)
        return (motor(t, 6.0) - pull) / MASS

    assert position[-1] > 24e-3
    assert_close(position, integrated(time, acceleration), accuracy)


@every_step
def test_cable_stiffness_swings_about_its_center(
    free, with_effects, effects, pushed, substeps, accuracy
):
    stage = with_effects(free, effects["cable_stiffness"].at(stiffness=30.0, center=0.01))
    time, position, _ = pushed(stage, 0.0, substeps=substeps, duration=2.0)
    expected = 0.01 * (1.0 - np.cos(math.sqrt(30.0 / MASS) * time))
    assert_close(position, expected, accuracy)


@every_step
def test_force_offset(free, with_effects, effects, pushed, substeps, accuracy):
    stage = with_effects(free, effects["force_offset"].at(force=1.5))
    time, position, force = pushed(stage, 0.0, substeps=substeps)
    assert_close(position, -0.5 * 1.5 / MASS * time**2, accuracy)
    assert np.abs(force).max() < 1e-9


@every_step
def test_floor_vibration(free, with_effects, effects, pushed, substeps, accuracy):
    values = {"amplitude": 0.6, "frequency": 37.0, "phase": 0.9}
    stage = with_effects(free, effects["floor_vibration"].at(**values))
    time, position, _ = pushed(stage, 0.0, substeps=substeps, duration=0.5)
    w = 2.0 * math.pi * 37.0
    expected = (
        0.6
        / MASS
        * (np.sin(w * time + 0.9) / w**2 - math.sin(0.9) / w**2 - math.cos(0.9) / w * time)
    )
    assert_close(position, expected, 4 * accuracy)


@every_step
def test_viscous_damping(free, with_effects, effects, pushed, substeps, accuracy):
    oily = replace(
        free,
        axes=tuple(replace(a, friction=replace(a.friction, viscous=20.0)) for a in free.axes),
    )
    stage = with_effects(oily, effects["viscous_damping"].at(ratio=2.0))
    time, position, _ = pushed(stage, 20.0, substeps=substeps, duration=0.4)
    expected = integrated(time, lambda t, x, v: (motor(t, 20.0) - 40.0 * v) / MASS)
    assert_close(position, expected, accuracy)


@every_step
def test_resonance_is_the_free_free_mode(free, with_effects, effects, pushed, substeps, accuracy):
    # Constant force on two masses: the common mass accelerates, the mode rings and dies out.
    values = {"frequency": 110.0, "damping": 0.03, "mass_ratio": 0.25}
    stage = with_effects(free, effects["resonance"].at(**values))
    time, position, _ = pushed(stage, 40.0, substeps=substeps, duration=0.08)
    light, w, zeta = 0.75 * MASS, 2.0 * math.pi * 110.0, 0.03

    def rates(t, s):
        force = motor(t, 40.0)
        stretch = -force / light - 2.0 * zeta * w * s[3] - w**2 * s[2]
        return s[1], force / MASS - 0.25 * stretch, s[3], stretch

    solution = solve_ivp(
        rates, (0.0, time[-1]), (0.0,) * 4, t_eval=time, rtol=1e-10, atol=1e-14, max_step=1e-3
    )
    ringing = solution.y[0] - travelled(time, 40.0)
    assert np.ptp(ringing) > 5e-6
    assert np.abs(position - solution.y[0]).max() < max(0.02 * np.ptp(ringing), accuracy * 0.016)
    # Damped out, momentum is that of the whole mass.
    assert np.polyfit(time[-20:], position[-20:], 2)[0] * 2 == pytest.approx(5.0, rel=0.05)


@every_step
def test_base_takes_the_reaction(free, with_effects, effects, pushed, substeps, accuracy):
    values = {"frequency": 8.0, "damping": 0.06, "mass_ratio": 0.05}
    stage = with_effects(free, effects["base_motion"].at(**values))
    time, position, _ = pushed(stage, 20.0, substeps=substeps, duration=0.4)
    base, w = MASS / 0.05, 2.0 * math.pi * 8.0

    def rates(t, s):
        force = motor(t, 20.0)
        return s[1], force / MASS, s[3], -force / base - 2.0 * 0.06 * w * s[3] - w**2 * s[2]

    solution = solve_ivp(rates, (0.0, time[-1]), (0.0,) * 4, t_eval=time, rtol=1e-10, atol=1e-14)
    moved = np.ptp(solution.y[2])
    assert moved > 5e-5
    expected = solution.y[0] - solution.y[2]
    assert np.abs(position - expected).max() < max(0.01 * moved, accuracy * np.ptp(expected))


def test_without_isolators_momentum_is_conserved(free, with_effects, effects, pushed):
    # A base on next to no spring runs away backwards: m v + M V = impulse of nobody = 0.
    values = {"frequency": 1e-4, "damping": 0.0, "mass_ratio": 0.04}
    stage = with_effects(free, effects["base_motion"].at(**values))
    time, position, _ = pushed(stage, 20.0)
    assert_close(position, travelled(time, 20.0) * (1.0 + 0.04), 1e-4)


@every_step
@pytest.mark.parametrize("back", [0.0, -0.4])
def test_cross_coupling_is_solved_jointly(
    free, with_effects, effects, pushed, substeps, accuracy, back
):
    coupling = effects["cross_coupling"]
    y = (coupling.at(mass=back),) if back else ()
    stage = with_effects(free, coupling.at(mass=0.6), y=y)
    masses = np.array([[MASS, 0.6], [back, 14.0]])
    accelerations = np.linalg.solve(masses, [4.0, 30.0])
    for axis in range(2):
        time, position, _ = pushed(stage, 4.0, across=30.0, substeps=substeps, axis=axis)
        assert_close(position, travelled(time, accelerations[axis], 1.0), accuracy)
