"""Whether a calibration can make a map, known before anything moves."""

from __future__ import annotations

from collections.abc import Sequence

from stagectl.errors import UnusableInput
from stagectl.history import Pair, StageKey, open_existing
from stagectl.maps import LEAST_SITES, SITE_RADIUS, PlaceIndex
from stagectl.run import RunRequest


def require_enough_sites(request: RunRequest, sites: Sequence[Pair]) -> None:
    """Refuse sites that make no map, together with the places that the history knows.

    Args:
        request: with machine and history.
        sites: to be visited [m].

    Raises:
        UnusableInput: they are too few.
        StagectlError: the history cannot be used.
    """
    known: list[Pair] = []
    history = open_existing(str(request.history))
    if history is not None:
        try:
            known = history.places(StageKey(request.machine.name, request.truth is not None))
        finally:
            history.close()
    places = PlaceIndex(SITE_RADIUS)
    count = 0
    for place in (*known, *sites):
        if not places.near(place):
            places.add(place)
            count += 1
    if count < LEAST_SITES:
        raise UnusableInput(
            f"{request.recipe.source}: sites: {count} make no map, those in the history included; "
            f"it takes {LEAST_SITES}, more than {SITE_RADIUS * 1e3:g} mm apart"
        )
