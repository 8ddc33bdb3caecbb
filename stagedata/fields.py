"""Fields of the records that kernels work on."""

from __future__ import annotations


def of_type(kind: str, *names: str) -> list[tuple[str, str]]:
    """Fields of one type of a record, as `numpy.dtype` takes them."""
    return [(name, kind) for name in names]
