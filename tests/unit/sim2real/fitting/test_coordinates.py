"""Scaled coordinates of an effect's parameters."""

from __future__ import annotations

import pytest

from hil_sim.effects.library import library
from sim2real.fitting import Term, coordinates
from sim2real.fitting.coordinates import from_coordinates, to_coordinates


@pytest.mark.parametrize("name", sorted(n for n in library() if not n.endswith("_table")))
def test_coordinates_go_there_and_back(nominal, name):
    axis = nominal[1].axes[0]
    effect = library()[name]
    values = []
    for parameter in effect.parameters:
        low, high = parameter.ranges(axis)[-1]
        values.append(0.4 * low + 0.6 * high)
    term = Term(effect, tuple(values))
    assert from_coordinates(term, axis, to_coordinates(term, axis)).values == pytest.approx(
        term.values
    )
    for entry, value in zip(coordinates(effect, axis), values, strict=True):
        step = 1e-6
        slope = (entry.outward(entry.inward(value) + step) - value) / step
        assert slope == pytest.approx(entry.slope(value), rel=1e-3)


@pytest.mark.parametrize("name", ["force_offset", "payload_mass", "viscous_damping"])
def test_what_every_machine_may_have_has_any_size(nominal, name):
    """A vertical axis carries many times its friction."""
    axis, effect = nominal[1].axes[0], library()[name]
    (entry,) = coordinates(effect, axis)
    _, high = effect.parameters[0].ranges(axis)[-1]
    assert entry.clipped(100.0 * high) == 100.0 * high
    (other, *_) = coordinates(library()["cogging"], axis)
    _, high = library()["cogging"].parameters[0].ranges(axis)[-1]
    assert other.clipped(100.0 * high) < 10.0 * high
