"""A spot with more friction: a bell over both axes, felt at the spot only."""

import numpy as np
import pytest

from hil_sim.plant.ports.port_arrays import build_ports
from tests.unit.hil_sim.effects.closed_forms import FC, SPEED, VISCOUS, both_steps

CENTER, OTHER, WIDTH = 0.03, 0.0, 4e-3


@pytest.fixture
def spot(effects):
    return effects["friction_spot"].at(amplitude=0.5, center=CENTER, other=OTHER, width=WIDTH)


def test_it_is_a_bell_over_both_positions(nominal, with_effects, spot):
    (ports, _) = build_ports(with_effects(nominal, spot), None)
    (field,) = ports.fields
    own, other = np.meshgrid(field.own, field.other, indexing="ij")
    bell = np.exp(-0.5 * ((own - CENTER) ** 2 + (other - OTHER) ** 2) / WIDTH**2)
    np.testing.assert_allclose(field.values, 1.0 + 0.5 * bell, atol=1e-12)
    assert np.diff(field.own).max() <= WIDTH / 8.0


@both_steps
def test_friction_rises_where_both_axes_are_there(nominal, with_effects, spot, sliding, substeps):
    _, position, force = sliding(with_effects(nominal, spot), substeps=substeps)
    plain = FC + VISCOUS * SPEED
    at_spot = np.abs(position - CENTER) < 1e-3
    assert force[at_spot].mean() == pytest.approx(plain + 0.5 * FC, rel=0.02)
    far = position > CENTER + 5 * WIDTH
    assert far.sum() > 20
    np.testing.assert_allclose(force[far], plain, rtol=0.01)


@both_steps
def test_beside_it_on_the_other_axis_nothing_is_felt(
    nominal, with_effects, effects, sliding, substeps
):
    aside = effects["friction_spot"].at(amplitude=0.5, center=CENTER, other=0.1, width=WIDTH)
    _, _, force = sliding(with_effects(nominal, aside), substeps=substeps)
    np.testing.assert_allclose(force, FC + VISCOUS * SPEED, rtol=2e-3)
