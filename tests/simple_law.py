"""The packaged machine with the simple friction law, as text."""

from __future__ import annotations

from stagectl.config import load_machine

OF_PRESLIDING = ("elements", "stiffness", "attraction")


def simple_law_text(*kept: str) -> str:
    """The packaged machine with the law coulomb on both axes; of presliding, what is `kept`."""
    gone = tuple(f"{key}:" for key in OF_PRESLIDING if key not in kept)
    lines = load_machine().text.replace("model: gms", "model: coulomb").splitlines(keepends=True)
    return "".join(line for line in lines if not line.strip().startswith(gone))
