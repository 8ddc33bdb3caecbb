"""Packages whose names are imported on first use."""

from __future__ import annotations

from importlib import import_module

import pytest


@pytest.mark.parametrize("room", ["history", "run", "sequencer", "store"])
def test_every_public_name_is_found(room):
    package = import_module(f"stagectl.{room}")
    for name in package.__all__:
        found = getattr(package, name)
        assert getattr(found, "__name__", name) == name or not callable(found)


def test_other_names_are_refused():
    package = import_module("stagectl.store")
    with pytest.raises(AttributeError, match=r"'stagectl\.store' has no attribute 'nothing'"):
        _ = package.nothing
