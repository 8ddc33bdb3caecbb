"""The gap of a recording by another program to the packaged machine."""

from pathlib import Path

import pytest

from sim2real.gap import compare_with_model
from stagectl.config import stage_settings
from stagectl.store import read_recording

NULL = Path(__file__).parents[4] / "data" / "null-2.h5"


@pytest.fixture(scope="session")
def settings(machine):
    return stage_settings(machine)


@pytest.fixture(scope="session")
def measured(settings):
    return compare_with_model(read_recording(NULL), settings, draws=1)
