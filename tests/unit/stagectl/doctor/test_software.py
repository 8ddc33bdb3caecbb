"""The software of this machine: where the kernels are."""

import pytest

from stagectl.doctor import Finding, examine


@pytest.fixture(scope="module")
def findings() -> list[Finding]:
    return list(examine(0.02))


def test_the_kernels_say_where_they_are(findings):
    kernels = findings[0]
    assert kernels.available
    assert "compiled here" in kernels.found
