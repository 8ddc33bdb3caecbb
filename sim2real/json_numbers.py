"""Numbers in the JSON of findings."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field, PlainSerializer

Number = Annotated[
    float,
    PlainSerializer(lambda v: float(v) if math.isfinite(v) else None, return_type=float | None),
]
"""Null in JSON where it is not finite, as JSON has neither nan nor infinity."""
Nodes = Annotated[tuple[Number, ...], Field(exclude_if=lambda values: not values)]
"""Part of the JSON only where there are any."""
NumberIfAny = Annotated[Number, Field(exclude_if=lambda value: not value)]
"""Part of the JSON only where it is not 0."""
