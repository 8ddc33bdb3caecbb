"""The pictures of what a model leaves, and the sentences where there is nothing to draw."""

from dataclasses import replace

import numpy as np
import pytest
from markupsafe import escape

from sim2real.residuals import view_residuals
from stagectl.report.gap import views
from stagectl.report.gap.views import draw_view


@pytest.fixture(scope="module")
def seen(measured, settings):
    return view_residuals([measured], [measured.floor.nominal], settings)["x"]


def test_each_picture_has_measured_before_and_after(seen):
    velocity = draw_view(views.velocity, [seen])
    assert [p.title for p in velocity.panels] == ["Axis x: all speeds", "Axis x: low speeds"]
    for panel in velocity.panels:
        of = {curve.name: curve for curve in panel.picture.curves}
        assert {"before", "after"} <= set(of)
        assert all(of[name].low is not None for name in ("before", "after")), "bands"
    assert len(draw_view(views.plane, [seen]).panels) == 2
    for view in (draw_view(views.reversal, [seen]), draw_view(views.response, [seen])):
        assert view.panels
        for panel in view.panels:
            assert {c.name for c in panel.picture.curves} == {"measured", "before", "after"}
            assert "NaN" not in escape(panel.picture)


def test_an_axis_that_turns_is_drawn_in_its_units(seen):
    turning = [replace(seen, settings=replace(seen.settings, rotary=True))]
    for draw, units in (
        (views.velocity, ("[mrad/s]", "[N m]")),
        (views.plane, ("[mrad]", "[mrad/s]", ">N m<")),
        (views.reversal, ("[µrad]", "[N m]")),
    ):
        for panel in draw_view(draw, turning).panels:
            drawn = escape(panel.picture)
            assert all(unit in drawn for unit in units)
            assert "[mm" not in drawn
            assert "[N]" not in drawn


def test_empty_data_are_a_sentence(seen):
    still = replace(seen, velocity=(), plane=None, response=None, reversals=())
    for draw in (views.velocity, views.plane, views.reversal, views.response):
        view = draw_view(draw, [still])
        assert view.panels == ()
        (sentence,) = view.missing
        assert sentence.startswith("Axis x")
    assert (
        "without a demand"
        in draw_view(views.response, [replace(still, has_demand=False)]).missing[0]
    )


def test_frequencies_that_are_not_excited_are_shaded_and_not_drawn(seen):
    response = seen.response
    none = replace(response, excited=np.zeros(len(response.frequency), dtype=bool))
    (sentence,) = draw_view(views.response, [replace(seen, response=none)]).missing
    assert "gap excite" in sentence
    some = replace(response, excited=response.frequency < 50.0)
    (magnitude, _) = draw_view(views.response, [replace(seen, response=some)]).panels
    assert magnitude.picture.shaded
    every = replace(response, excited=np.ones(len(response.frequency), dtype=bool))
    (magnitude, _) = draw_view(views.response, [replace(seen, response=every)]).panels
    assert not magnitude.picture.shaded


def test_speeds_that_did_not_occur_are_not_bridged(seen):
    (panel, *_) = draw_view(views.velocity, [seen]).panels
    forward = seen.velocity[-1]
    jumped = replace(forward, bins=forward.bins + 5 * (np.arange(len(forward.bins)) > 3))
    (split, *_) = draw_view(
        views.velocity, [replace(seen, velocity=(*seen.velocity[:-1], jumped))]
    ).panels
    assert len(split.picture.curves) == len(panel.picture.curves) + 2
