"""Validation of a parsed file against a pydantic model, with messages for the operator.

`validate` turns each pydantic error into one line `file:line:column: key: reason`. For an unknown
key it suggests a known one.
"""

from __future__ import annotations

import difflib
import json
import re
from collections.abc import Iterator
from dataclasses import is_dataclass
from typing import Any, Literal, TypeVar, get_args, get_origin, get_type_hints

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import ErrorDetails, PydanticCustomError

from stagectl.config.parsing.yaml_nodes import Document, describe_value
from stagectl.errors import ConfigError
from stagectl.plain_text import one_line

MAX_PROBLEMS = 100
"""Problems that are listed; the rest is only counted."""

KINDS = {
    "bus": "a machine file",
    "recipe": "a recipe",
    "calibrate": "a calibration file",
    "faults": "a faults file",
    "family": "a drive profile",
}
"""A key that only this kind of file has."""

M = TypeVar("M", bound=BaseModel)
_UNKNOWN_KEY = ("extra_forbidden", "unexpected_keyword_argument")

STRICT = ConfigDict(extra="forbid", allow_inf_nan=False, strict=True)
"""Of a section that is a pydantic dataclass, since the program makes such values too.

A dataclass of a lower package can be a section as it is, its annotations the ranges.
"""


class Section(BaseModel):
    """Base of the other models of files: frozen, without unknown keys."""

    model_config = ConfigDict(**STRICT, frozen=True)


def refusal(reason: str) -> PydanticCustomError:
    """What a validator raises to refuse a value, for a reason in the operator's words."""
    return PydanticCustomError("reason", "{reason}", {"reason": reason})


def validate(document: Document, model: type[M], data: object = None) -> M:
    """The document as a model; `data` are its values where some were replaced.

    Raises:
        ConfigError: every problem found, in the order of the file; only that it is of another
            kind where it is.
    """
    if (reason := _why_another_kind(document.data, model)) is not None:
        raise ConfigError(document.problem((), reason))
    problems = list(document.problems)
    try:
        values = json.dumps(document.data if data is None else data)
        result = model.model_validate_json(values)  # strict, but lists and mappings are JSON's
    except ValidationError as error:
        refused = {_place(p) for p in problems}  # their placeholders may be refused again
        errors = _without_misspelt(model, error.errors(include_url=False))
        lines = (_line(document, model, e) for e in errors[:MAX_PROBLEMS])
        problems += [line for line in lines if _place(line) not in refused]
        problems = sort_problems(problems)
        if (more := len(errors) - MAX_PROBLEMS) > 0:
            problems.append(f"{document.name}: and {more} more problems")
        raise ConfigError(problems) from None
    if problems:
        raise ConfigError(sort_problems(problems))
    return result


def _why_another_kind(data: object, model: type[BaseModel]) -> str | None:
    wanted = next((kind for key, kind in KINDS.items() if key in model.model_fields), None)
    if not isinstance(data, dict) or wanted is None:
        return None
    kinds = [kind for key, kind in KINDS.items() if key in data]
    return f"is {kinds[0]}, not {wanted}" if len(kinds) == 1 and kinds[0] != wanted else None


def sort_problems(problems: list[str]) -> list[str]:
    """Problems of one file by line and column, without duplicates."""
    return sorted(dict.fromkeys(problems), key=_place)


def _place(problem: str) -> tuple[int, int]:
    match = re.search(r":(\d+):(\d+): ", problem)
    return (int(match[1]), int(match[2])) if match else (0, 0)


def suggest(word: str, known: list[str]) -> str:
    """`; did you mean 'x'?`, or the list of known words if none is similar."""
    if near := _nearest(word, known):
        return f"; did you mean '{near}'?"
    return f"; known: {', '.join(known)}" if known else ""


def _nearest(word: str, known: list[str]) -> str | None:
    return next(iter(difflib.get_close_matches(word, known, n=1, cutoff=0.6)), None)


def _without_misspelt(model: type[BaseModel], errors: list[ErrorDetails]) -> list[ErrorDetails]:
    """The errors, but not that a key is missing if it is there misspelt."""
    misspelt = {
        (*location[:-1], _nearest(str(location[-1]), _known_keys(model, location[:-1])))
        for location in (e["loc"] for e in errors if e["type"] in _UNKNOWN_KEY)
    }
    return [e for e in errors if e["type"] != "missing" or e["loc"] not in misspelt]


def _line(document: Document, model: type[BaseModel], error: ErrorDetails) -> str:
    location, kind = error["loc"], error["type"]
    if kind in _UNKNOWN_KEY:
        word = str(location[-1])
        reason = f"unknown key{suggest(word, _known_keys(model, location[:-1]))}"
        return document.problem(location, reason, at_key=True)
    if kind == "union_tag_invalid":
        tag = str(error["ctx"]["discriminator"]).strip("'")
        known = re.findall(r"'([^']*)'", str(error["ctx"]["expected_tags"]))
        word = str(error["ctx"]["tag"])
        reason = f"must be one of {', '.join(known)}, is {describe_value(word)}"
        return document.problem((*location, tag), reason)
    if kind == "union_tag_not_found":
        tag = str(error["ctx"]["discriminator"]).strip("'")
        return document.problem((*location, tag), "is missing")
    if location and location[-1] == "[key]":
        return document.problem(location[:-1], _reason(error), at_key=True)
    return document.problem(location, _reason(error))


_REASONS = {
    "missing": "is missing",
    **dict.fromkeys(
        ("model_type", "model_attributes_type", "dataclass_type", "dict_type", "mapping_type"),
        "must be a mapping (key: value), {is_what}",
    ),
    **dict.fromkeys(("list_type", "tuple_type"), "must be a list, {is_what}"),
    "greater_than": "must be > {gt:g}, {is_what}",
    "greater_than_equal": "must be >= {ge:g}, {is_what}",
    "less_than": "must be < {lt:g}, {is_what}",
    "less_than_equal": "must be <= {le:g}, {is_what}",
    **dict.fromkeys(
        ("int_type", "int_parsing", "int_from_float"), "must be a whole number, {is_what}"
    ),
    "string_type": "must be a text, {is_what}",
    **dict.fromkeys(
        ("string_too_short", "string_too_long"), "must have 1 to 200 characters, {is_what}"
    ),
    "string_pattern_mismatch": "must be a word of at most 32 letters, digits and _, {is_what}",
    "too_short": "must have at least {min_length} item(s), has {actual_length}",
    "too_long": "must have at most {max_length} item(s), has {actual_length}",
    "literal_error": "must be {expected}, {is_what}",
}
"""By pydantic's name of what is wrong, with its figures."""


def _reason(error: ErrorDetails) -> str:
    kind, value, ctx = error["type"], error["input"], error.get("ctx", {})
    if kind == "reason":
        return str(ctx.get("reason", error["msg"]))
    is_what = f"is {describe_value(value)}"
    if kind == "string_type" and isinstance(value, int | float):
        is_what += " (write it in quotes)"
    if kind in _REASONS:
        return _REASONS[kind].format(is_what=is_what, **ctx)
    return one_line(f"{error['msg']}, {is_what}", 300)


def _known_keys(model: type, location: tuple[str | int, ...]) -> list[str]:
    """The keys of the model at a location; those of all members of a union."""
    models = {model}
    for part in location:
        inner = {m for one in models for m in _models_in(_fields(one).get(str(part)))}
        # List indices, keys of mappings and tags of unions are not fields and do not descend;
        # a tag selects the one member of the union that was tried.
        models = inner or {m for m in models if _has_tag(m, part)} or models
    return list(dict.fromkeys(key for one in sorted(models, key=str) for key in _fields(one)))


def _has_tag(model: type, part: str | int) -> bool:
    """Whether this is the model's tag in a union: its name or its only literal value."""
    return part == model.__name__ or any(
        get_origin(annotation) is Literal and get_args(annotation) == (part,)
        for annotation in _fields(model).values()
    )


def _fields(model: type) -> dict[str, Any]:
    """The keys of a section with their annotations."""
    fields = getattr(model, "__pydantic_fields__", None)
    if fields is None:
        return get_type_hints(model)
    return {f.alias or name: f.annotation for name, f in fields.items()}


def _models_in(annotation: Any) -> Iterator[type]:
    if isinstance(annotation, type) and (
        is_dataclass(annotation) or hasattr(annotation, "__pydantic_fields__")
    ):
        yield annotation
    for argument in get_args(annotation):
        yield from _models_in(argument)
