"""Text that fits on one line of a terminal: no line breaks, no control characters."""

from __future__ import annotations

import unicodedata
from typing import Final

_CONTROLS: Final = frozenset(("Cc", "Cf", "Cs", "Zl", "Zp"))
"""Unicode categories: controls and escapes, invisible formats, halves of surrogates, separators."""


def find_control(text: str) -> str | None:
    """Why a text cannot be shown on one line: its first control character, or None.

    Line breaks, terminal escapes, bidirectional overrides and halves of surrogate pairs count.
    """
    for char in text:
        if unicodedata.category(char) in _CONTROLS:
            return f"holds the control character U+{ord(char):04X}"
    return None


def one_line(text: object, limit: int = 80) -> str:
    """The text on one line, without control characters, of at most `limit` characters."""
    line = "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in str(text))
    return line if len(line) <= limit else line[: limit - 3] + "..."
