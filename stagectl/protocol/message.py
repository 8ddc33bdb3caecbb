"""The base of all messages: unknown keys and wrong types are refused, and nothing changes later."""

from __future__ import annotations

from typing import Annotated

from annotated_types import Ge, Le
from pydantic import BaseModel, ConfigDict, StringConstraints

VERSION = 1

Name = Annotated[
    str, StringConstraints(min_length=1, max_length=64, pattern=r"^[^\x00-\x1f\x7f]*$")
]
"""One line, as shown to all."""
Text = Annotated[str, StringConstraints(max_length=500, pattern=r"^[^\x00-\x1f\x7f]*$")]
Index = Annotated[int, Ge(0), Le(2**31)]
Finite = Annotated[float, Ge(-1e9), Le(1e9)]
"""An SI quantity; no NaN, no infinity."""


class Message(BaseModel):
    """A part of a message."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
