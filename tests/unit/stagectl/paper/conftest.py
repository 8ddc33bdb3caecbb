"""One study for all tests: some two seconds."""

import pytest

from stagectl.paper import Case, study
from stagectl.paper.simulate import prepare


@pytest.fixture(scope="session")
def quick():
    return study.run(Case(), quick=True)


@pytest.fixture(scope="session")
def move():
    return prepare(Case())
