"""Forces that no friction figure explains: found, kept out of the figures, or refused by name."""

from dataclasses import replace

import numpy as np
import pytest

from estimation.online import BeliefSettings
from estimation.online.estimator import SplitHorizonEstimator
from hil_sim.effects.library import library
from tests.unit.estimation.online.moves import SEQUENCE, SETTINGS, TRUE, drive, learn, only_x

AS_IN_A_RUN = replace(
    SETTINGS,
    request=("lag", "relaxation_rate"),
    consider=("static_ratio",),
    belief=BeliefSettings(unmodelled=0.1, variation=0.03, scatter=0.1),
)
"""As the host sets it up."""


def stage(effect=None, **figures):
    """Axis x with other friction figures, or with an effect."""
    settings = only_x()
    x = settings.axes[0]
    x = replace(x, friction=replace(x.friction, **figures))
    if effect is not None:
        name, parameters = effect
        x = replace(x, effects=(library()[name].at(**parameters),))
    return replace(settings, axes=(x,))


@pytest.mark.parametrize(
    "effect",
    [
        ("force_offset", {"force": 2.0}),
        ("cable_stiffness", {"stiffness": 30.0, "center": -0.04}),
        ("cogging", {"amplitude": 1.2, "pitch": 0.03, "phase": 1.0}),
        ("friction_asymmetry", {"ratio": 0.2}),
    ],
    ids=lambda effect: effect[0],
)
def test_a_force_that_is_not_friction_does_not_become_friction(effect):
    """It put Fc a fifth off in either direction, with a sigma of a hundredth."""
    data = drive(SEQUENCE * 2, stage(effect))
    estimates = learn(SplitHorizonEstimator(TRUE.scaled(0.5), AS_IN_A_RUN), data)
    accepted = [estimate for estimate in estimates if estimate.accepted]
    assert len(accepted) >= 0.6 * len(estimates)
    for estimate in accepted[2:]:
        value, sigma = estimate.sliding
        assert abs(value - 6.0) < 4.0 * np.hypot(sigma, 0.06)
        away = abs(estimate.friction.stiffness - 6e5)
        assert away < max(4.0 * estimate.sigma["stiffness"], 0.03 * 6e5)


def test_a_constant_force_is_found():
    data = drive(SEQUENCE * 2, stage(("force_offset", {"force": 2.0})))
    estimator = SplitHorizonEstimator(TRUE, AS_IN_A_RUN)
    learn(estimator, data)
    value, sigma = estimator.unmodelled_force
    assert value == pytest.approx(2.0, abs=3.0 * sigma)
    assert value > 1.0


def test_without_one_it_is_learned_that_there_is_none():
    estimator = SplitHorizonEstimator(TRUE, AS_IN_A_RUN)
    learn(estimator, drive(SEQUENCE * 2))
    value, sigma = estimator.unmodelled_force
    assert abs(value) < 3.0 * sigma
    assert sigma < 0.05 * 6.0


@pytest.mark.parametrize("first", [7, 8], ids=["micro-move first", "macro-move first"])
@pytest.mark.parametrize("scale", [1.2, 0.85])
def test_a_force_that_is_scaled_in_mid_run_is_refused_as_such(scale, first):
    """0x6077 read with another factor: all friction figures follow it, and so does m a."""
    data = drive(SEQUENCE * 2)
    estimator = SplitHorizonEstimator(TRUE.scaled(0.5), AS_IN_A_RUN)
    learn(estimator, data, range(first))
    before = estimator.friction
    for number in range(first, 16):
        move = data.move(number)
        estimate = estimator.update(
            replace(move, force=scale * move.force, rest_force=scale * move.rest_force)
        )
        if number >= 8:  # a micro-move does not show it; what it taught is taken back
            assert not estimate.accepted
            assert "force per acceleration changes" in estimate.reason
            assert "0x6077" in estimate.reason
    assert estimator.friction.coulomb == pytest.approx(before.coulomb, rel=0.02)
    assert estimator.friction.stiffness == pytest.approx(before.stiffness, rel=0.02)
    learn(estimator, data, range(2))
    again = [estimator.update(data.move(number)) for number in range(2, 6)]
    assert again[-1].accepted


@pytest.mark.parametrize("times", [5.0, 8.0])
@pytest.mark.parametrize("attraction", ["also", "not"])
def test_a_coulomb_force_far_beyond_the_start_is_learned_from_the_first_macro_move(
    times, attraction
):
    """It was refused for ever beyond 4.6 times the start, then for two macro-moves.

    Where the attraction is not as far off, C/Fc is, as far as its bounds.
    """
    rate = TRUE.relaxation_rate * (1.0 if attraction == "also" else times)
    start = replace(TRUE, coulomb=6.0 / times, relaxation_rate=rate)
    estimator = SplitHorizonEstimator(start, AS_IN_A_RUN)
    data = drive(SEQUENCE)
    (estimate,) = learn(estimator, data, range(1))
    assert estimate.accepted
    assert estimate.sliding[0] == pytest.approx(6.0, rel=0.05)
    estimates = [estimator.update(data.move(n)) for n in range(1, 5)]
    assert all(estimate.accepted for estimate in estimates)
    assert estimator.friction.coulomb == pytest.approx(6.0, rel=0.1)
    assert abs(estimator.friction.coulomb - 6.0) < 4.0 * estimator.sigma["coulomb"]


def test_the_relaxation_rate_of_soft_contacts_is_learned():
    """From macro-moves and moves of two breakaway travels alone it stayed where it began."""
    soft = {"coulomb": 6.0 * 1.41, "stiffness": 6e5 * 0.67, "relaxation_rate": 54.0}
    estimator = SplitHorizonEstimator(TRUE.scaled(0.5), AS_IN_A_RUN)
    learn(estimator, drive(SEQUENCE * 2, stage(**soft)))
    # It began at 100; alpha, which is held, makes it uncertain.
    sigma = estimator.sigma["relaxation_rate"]
    assert sigma < 8.0
    assert abs(estimator.friction.relaxation_rate - 54.0) < 2.5 * sigma
    assert abs(estimator.friction.relaxation_rate - 54.0) < 4.0 * estimator.sigma["relaxation_rate"]
    assert estimator.friction.coulomb * estimator.level == pytest.approx(8.46, rel=0.03)


def test_a_held_alpha_counts_in_sigma_and_stays():
    """With alpha 1.0 instead of 0.4, the first C/Fc was 3.2 sigma off."""
    data = drive(SEQUENCE * 2, stage(static_ratio=1.0))
    for estimate in learn(SplitHorizonEstimator(TRUE.scaled(0.5), AS_IN_A_RUN), data):
        assert estimate.static_ratio[0] == 0.4
        value, sigma = estimate.sliding
        assert abs(value - 6.0) < 2.5 * np.hypot(sigma, 0.06)
        away = abs(estimate.friction.relaxation_rate - 100.0)
        assert away < 2.5 * estimate.sigma["relaxation_rate"]


def test_nothing_is_learned_where_the_model_misses_a_fifth_of_the_coulomb_force():
    """Floor vibration looked like a sigma0 of a seventeenth, known to a tenth."""
    effect = ("floor_vibration", {"amplitude": 1.5, "frequency": 40.0, "phase": 0.0})
    estimator = SplitHorizonEstimator(TRUE.scaled(0.5), AS_IN_A_RUN)
    estimates = learn(estimator, drive(SEQUENCE * 2, stage(effect)))
    assert not any(estimate.accepted for estimate in estimates)
    assert any("the model misses" in estimate.reason for estimate in estimates)
    assert estimator.friction == TRUE.scaled(0.5)


def test_what_the_model_misses_does_not_confirm_itself_under_noise():
    """With 20 nm of encoder noise at a SYNC of 0.25 ms it grew until most moves were refused.

    The residual is then as large as the noise explains, whatever the model is thought to miss.
    """
    noise = 150e-9
    estimator = SplitHorizonEstimator(TRUE.scaled(0.5), replace(AS_IN_A_RUN, position_noise=noise))
    data = drive(SEQUENCE * 4)
    generator = np.random.default_rng(5)
    data.position += generator.normal(0.0, noise, len(data.position))
    estimates = learn(estimator, data)
    macro = estimates[2::2]
    assert all(estimate.accepted for estimate in macro)
    assert estimator.friction.coulomb * estimator.level == pytest.approx(6.0, rel=0.05)
    assert estimator.sigma["coulomb"] < 0.4
