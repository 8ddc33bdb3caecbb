"""The software of this machine: where the kernels are."""


def test_the_kernels_say_where_they_are(findings):
    kernels = findings[0]
    assert kernels.available
    assert "compiled here" in kernels.found
