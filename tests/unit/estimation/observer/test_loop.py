"""The linear axis against small steps, closed forms, and the modes that it was given."""

from dataclasses import replace

import numpy as np
import pytest

from estimation.observer import Carriage, Mode
from estimation.observer.loop import DEVIATION, INTEGRAL, period_maps
from tests.unit.estimation.observer.axes import CARRIAGE, DRIVE, PERIOD, Plant


def test_a_period_is_that_of_small_steps():
    maps, plant = period_maps(DRIVE, CARRIAGE, PERIOD), Plant()
    generator = np.random.default_rng(1)
    state, before = np.zeros(5), 0.0
    for _ in range(20):
        offset, push = generator.normal(size=2)
        noise = 1e-7 * generator.normal(size=10)
        errors = plant.advance(before, offset, push, noise, steps=400)
        expected = maps.error @ state + maps.error_from * before + maps.error_to * offset
        # the disturbance reaches the errors of its own period too, which the maps do not say
        state = (
            maps.transition @ state + maps.ramp_from * before + maps.ramp_to * offset
            + maps.noise @ noise + maps.disturbance * push
        )  # fmt: skip
        first = expected[0] + maps.error_noise[0] @ noise
        assert errors[0] == pytest.approx(first, rel=2e-3, abs=1e-9)
        before = offset
    assert state[DEVIATION] == pytest.approx(plant.deviation, rel=2e-3)
    assert state[INTEGRAL] == pytest.approx(plant.integral, rel=2e-3)


@pytest.mark.parametrize("delay", [0.1e-3, 0.25e-3, 0.31e-3])
def test_a_delay_shifts_the_force(delay):
    """A step of the offset acts as that of a drive without delay, so much later."""

    def deviations(late, periods):
        maps = period_maps(replace(DRIVE, kp=0.0, ki=0.0, kd=0.0, delay=late), FREE, 1e-4)
        state, found = np.zeros(len(maps.transition)), [0.0]
        for _ in range(periods):
            state = maps.transition @ state + maps.ramp_to
            state = state + (maps.ramp_from if len(found) > 1 else 0.0)
            found.append(state[DEVIATION])
        return np.array(found)

    at_once, later = deviations(0.0, 400), deviations(delay, 400)
    shifted = np.interp(np.arange(300, 400) - delay / 1e-4, np.arange(401), at_once)
    np.testing.assert_allclose(later[300:400], shifted, rtol=1e-4)


FREE = Carriage(8.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("carriage", "frequency", "damping"),
    [
        (replace(FREE, hung=(Mode(0.2, 110.0, 0.03),)), 110.0, 0.03),
        (replace(FREE, base=Mode(0.03, 10.0, 0.1)), 10.0, 0.1),
    ],
    ids=["hung on the carriage", "base"],
)
def test_modes_have_their_frequency_and_damping(carriage, frequency, damping):
    loop_off = replace(DRIVE, kp=0.0, ki=0.0, kd=0.0)
    maps = period_maps(loop_off, carriage, PERIOD)
    poles = np.log(np.linalg.eigvals(maps.transition).astype(complex)) / PERIOD
    swinging = poles[np.argmax(np.where(np.isfinite(poles), poles.imag, -np.inf))]
    assert abs(swinging) / (2.0 * np.pi) == pytest.approx(frequency, rel=1e-6)
    assert -swinging.real / abs(swinging) == pytest.approx(damping, rel=1e-5)


def test_a_force_accelerates_all_that_hangs_on_the_carriage():
    loop_off = replace(DRIVE, kp=0.0, ki=0.0, kd=0.0)
    hung = replace(FREE, hung=(Mode(0.2, 110.0, 0.5),))
    found = []
    for carriage in (FREE, hung):
        maps = period_maps(loop_off, carriage, PERIOD)
        state = np.zeros(len(maps.transition))
        for _ in range(500):
            state = maps.transition @ state + maps.disturbance
        found.append(state[DEVIATION])
    assert found[1] == pytest.approx(found[0], rel=1e-3)
    assert found[0] == pytest.approx(-0.5 * 0.5**2 / 8.0, rel=1e-6)
