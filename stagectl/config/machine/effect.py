"""An effect of a machine file: a name and figures, which the simulator checks."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, NamedTuple

from pydantic import BeforeValidator

from stagectl.config.parsing.validation import refusal
from stagectl.config.parsing.yaml_nodes import describe_value


class Effect(NamedTuple):
    """A physical effect by name, with its parameters (SI): numbers, or tuples of them."""

    name: str
    parameters: Mapping[str, Any]


def _effect(value: object) -> Effect:
    """`{effect: NAME, KEY: NUMBER or LIST, ...}`; the simulator checks the keys of each effect."""
    if not isinstance(value, dict):
        raise refusal(
            f"must be a mapping {{effect: name, key: number}}, is {describe_value(value)}"
        )
    name = value.get("effect")
    if not isinstance(name, str) or not name:
        raise refusal("needs the key effect with the effect's name")
    figures: dict[str, Any] = {}
    for key, figure in value.items():
        if key == "effect":
            continue
        if isinstance(figure, list):
            figures[key] = tuple(_number(name, f"{key}[{i}]", one) for i, one in enumerate(figure))
        else:
            figures[key] = _number(name, key, figure)
    return Effect(name, figures)


def _number(effect: str, key: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise refusal(f"{effect}: {key} must be a number (SI), is {describe_value(value)}")
    return float(value)


GivenEffect = Annotated[Effect, BeforeValidator(_effect)]
"""An effect as it stands in a machine file."""
