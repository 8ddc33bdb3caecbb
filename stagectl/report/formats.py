"""Figures, times and places as text."""

from __future__ import annotations

import math
from datetime import datetime

DASH = "\N{EN DASH}"
"""For a value that is unknown."""
_EXACT = 1e-3
"""Part in per cent that may be missing from all of something."""


def digits(value: float | None) -> str:
    """Three significant digits, without an exponent unless the text would be long."""
    if value is None or not math.isfinite(value):
        return DASH
    if value == 0:
        return "0"
    if not 1e-3 <= abs(value) < 1e8:
        return f"{value:.2e}"
    decimals = max(0, 2 - math.floor(math.log10(abs(value))))
    return f"{value:,.{decimals}f}".replace(",", " ")


def with_sigma(value: float, sigma: float) -> tuple[str, str]:
    """Value and sigma, both rounded to two digits of sigma."""
    if not (math.isfinite(sigma) and sigma > 0):
        return digits(value), DASH
    decimals = max(1 - math.floor(math.log10(sigma)), 0)
    if decimals > 9 or abs(value) >= 1e8:
        return f"{value:.4g}", f"{sigma:.2g}"
    value_text, sigma_text = (f"{v:,.{decimals}f}".replace(",", " ") for v in (value, sigma))
    return value_text, sigma_text


def percent(share: float | None, decimals: int = 0, signed: bool = False) -> str:
    """A share in per cent; a dash where it is unknown. Only all of something is 100 %."""
    if share is None or not math.isfinite(share):
        return DASH
    missing = 100.0 * (1.0 - share)
    if _EXACT < missing < 0.5 * 0.1**decimals:
        decimals = math.ceil(-math.log10(missing))
        share = math.floor(10.0 ** (decimals + 2) * share) / 10.0 ** (decimals + 2)
    return f"{100 * share:{'+' if signed else ''}.{decimals}f} %"


def micrometres(value: float | None) -> str:
    """A length [m] in µm with three significant digits."""
    return digits(None if value is None else value * 1e6)


def milliseconds(value: float | None) -> str:
    """A time [s] in ms."""
    if value is None or not math.isfinite(value):
        return DASH
    return f"{value * 1e3:.1f}".removesuffix(".0")


def window_name(key: str) -> str:
    """A settling window from its key: "5e-08" -> "±50 nm"."""
    return f"±{float(key) * 1e9:g} nm"


def place(at: tuple[float, float]) -> str:
    """A place on the table [m] in mm."""
    return f"({at[0] * 1e3:.1f}, {at[1] * 1e3:.1f})"


def date(started: str) -> str:
    """An ISO 8601 date to the second; any other text unchanged."""
    try:
        return f"{datetime.fromisoformat(started):%Y-%m-%d %H:%M:%S %Z}".strip()
    except ValueError:
        return started


def listed(names: list[str]) -> str:
    """Names as in a sentence: a, b and c."""
    return " and ".join(", ".join(names).rsplit(", ", 1))


def sentence(text: str) -> str:
    """With a capital letter and a full stop."""
    whole = text if text.endswith((".", "!", "?")) else text + "."
    return whole[:1].upper() + whole[1:]
