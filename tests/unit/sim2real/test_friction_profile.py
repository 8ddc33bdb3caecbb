"""Friction that differs from place to place, told from whatever else there is."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from hil_sim.effects.library import library
from hil_sim.settings import StageSettings
from sim2real.examine import examine
from sim2real.friction_profile import Profile, friction_profile
from sim2real.recording import Recording
from sim2real.shape import bell
from tests.unit.sim2real.conftest import stage_with

Effects = dict[str, dict[str, float]]


@pytest.fixture
def profile_with(nominal: tuple[Recording, StageSettings]) -> Callable[[Effects], Profile]:
    def profile(effects: Effects) -> Profile:
        recording = stage_with(nominal, 21, 10.0, x=effects)
        examined = examine([recording], nominal[1])
        return friction_profile("x", {}, examined.measured, nominal[1])

    return profile


@pytest.mark.parametrize(
    "effects",
    [
        {"rough_stretch": {"amplitude": 0.3, "center": 0.01, "width": 0.015}},
        {"friction_position": {"amplitude": -0.3, "center": -0.01, "width": 0.012}},
    ],
)
def test_friction_over_position_is_foretold(
    profile_with: Callable[[Effects], Profile], effects: Effects
) -> None:
    assert profile_with(effects).share > 0.6


@pytest.mark.parametrize(
    "effects",
    [
        {},
        {"coulomb_level": {"ratio": 1.25}},
        {"viscous_damping": {"ratio": 1.8}},
        {"thermal_drift": {"amplitude": 0.3, "time_constant": 4.0}},
        {"cogging": {"amplitude": 1.5, "pitch": 0.032, "phase": 1.0}},
        {"force_ripple": {"ratio": 0.06, "pitch": 0.012, "phase": 1.0}},
        {"resonance": {"frequency": 90.0, "damping": 0.02, "mass_ratio": 0.1}},
    ],
    ids=lambda effects: next(iter(effects), "none"),
)
def test_nothing_else_is(profile_with: Callable[[Effects], Profile], effects: Effects) -> None:
    assert profile_with(effects).share < 0.4


def test_a_bell_begins_where_friction_is_farthest_from_its_mean(
    profile_with: Callable[[Effects], Profile], nominal: tuple[Recording, StageSettings]
) -> None:
    profile = profile_with(
        {"friction_position": {"amplitude": 0.4, "center": 0.012, "width": 0.006}}
    )
    values = bell(library()["friction_position"], profile, nominal[1].axes[0]).mapping()
    assert values["center"] == pytest.approx(0.012, abs=4e-3)
    assert values["amplitude"] == pytest.approx(0.4, rel=0.4)
