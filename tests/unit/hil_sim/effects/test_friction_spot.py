"""A spot with more friction: a bell over both axes."""

import numpy as np

from hil_sim.plant.ports.port_arrays import build_ports

CENTER, OTHER, WIDTH = 0.03, 0.0, 4e-3


def test_it_is_a_bell_over_both_positions(nominal, with_effects, effects):
    spot = effects["friction_spot"].at(amplitude=0.5, center=CENTER, other=OTHER, width=WIDTH)
    (ports, _) = build_ports(with_effects(nominal, spot), None)
    (field,) = ports.fields
    own, other = np.meshgrid(field.own, field.other, indexing="ij")
    bell = np.exp(-0.5 * ((own - CENTER) ** 2 + (other - OTHER) ** 2) / WIDTH**2)
    np.testing.assert_allclose(field.values, 1.0 + 0.5 * bell, atol=1e-12)
    assert np.diff(field.own).max() <= WIDTH / 8.0
