"""Rooms whose names are imported on first use: each name of their stub exists."""

from importlib import import_module

import pytest


@pytest.mark.parametrize("room", ["history", "importing", "run", "sequencer", "store"])
def test_every_public_name_is_found(room):
    package = import_module(f"stagectl.{room}")
    assert package.__all__
    for name in package.__all__:
        assert getattr(package, name) is not None
    with pytest.raises(AttributeError, match="nothing_of_the_kind"):
        _ = package.nothing_of_the_kind
