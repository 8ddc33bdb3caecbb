"""What this machine has, examined once."""

import pytest

from stagectl.doctor import examine


@pytest.fixture(scope="session")
def findings():
    return list(examine(0.02))
