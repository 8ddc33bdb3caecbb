"""The pages of docs/reference that are made from the program: `python tools/reference.py`.

Of files: every key with unit, range and default, from the models that validate it; what a key means
is the text behind its field. Of drives: the objects that the host uses, and the virtual drive's
EDS.
"""

from __future__ import annotations

import ast
import dataclasses
import inspect
import math
import textwrap
import types
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import canopen
from annotated_types import Ge, Gt, Interval, Le, Lt
from canopen.objectdictionary import ODVariable
from pydantic import BaseModel, BeforeValidator
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from drivers import objects
from hil_sim import EDS_PATH
from stagectl.config.machine import Machine
from stagectl.config.machine.plausible import Plausible
from stagectl.config.parsing.units import Converter
from stagectl.recipe.schema import RecipeFile

FOLDER = Path(__file__).parents[1] / "docs" / "reference"
REQUIRED = object()
"""Instead of a default."""


@dataclass
class Facts:
    """What the annotation of a key says.

    Attributes:
        types: that its value may have, None and sections left out.
        sections: models among them.
        metadata: of all levels of `Annotated`.
        many: "list", "by name" or "N values"; "" for one value.
    """

    types: list[Any] = field(default_factory=list)
    sections: list[type] = field(default_factory=list)
    metadata: list[Any] = field(default_factory=list)
    many: str = ""

    def add(self, annotation: Any) -> Facts:
        """Take an annotation apart."""
        origin, inside = get_origin(annotation), get_args(annotation)
        if origin is Annotated:
            self.metadata += inside[1:]
            self.add(inside[0])
        elif origin in (Union, types.UnionType):
            for one in inside:
                self.add(one)
        elif origin in (list, tuple):
            pair = origin is tuple and ... not in inside
            self.many = f"{len(inside)} values" if pair else self.many or "list"
            self.add(inside[0])
        elif origin is not None and origin is not Literal:
            self.many = "by name"
            self.add(inside[-1])
        elif _is_section(annotation):
            self.sections.append(annotation)
        elif annotation is not types.NoneType:
            self.types.append(annotation)
        return self


def _is_section(annotation: Any) -> bool:
    return hasattr(annotation, "__pydantic_fields__") or dataclasses.is_dataclass(annotation)


@dataclass(frozen=True)
class Key:
    """A key of a section: its name, what its annotation says, its default and what it means."""

    name: str
    facts: Facts
    default: Any
    meaning: str

    def row(self) -> str:
        """Its row of the table."""
        unit, limits = _unit(self.facts), _range(self.facts)
        cells = (f"`{self.name}`", unit, limits, _default(self.default), self.meaning)
        return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def keys(model: type) -> Iterator[Key]:
    """The keys of a section in the order of its model."""
    texts, hints = _texts(model), get_type_hints(model, include_extras=True)
    if (pydantic := getattr(model, "__pydantic_fields__", None)) is not None:
        for name, given in pydantic.items():
            default = given.get_default(call_default_factory=True)
            default = REQUIRED if default is PydanticUndefined else default
            yield Key(given.alias or name, Facts().add(hints[name]), default, texts[name])
    else:
        for one in dataclasses.fields(model):
            yield Key(one.name, Facts().add(hints[one.name]), one.default, texts[one.name])


def _texts(model: type) -> dict[str, str]:
    """The text behind each field, those of its bases included."""
    found: dict[str, str] = {}
    for one in reversed(model.__mro__):
        if one in (object, BaseModel):
            continue
        (made,) = ast.parse(textwrap.dedent(inspect.getsource(one))).body
        body = made.body if isinstance(made, ast.ClassDef) else []
        for before, after in pairwise(body):
            match before, after:
                case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(
                    value=ast.Constant(value=str(text))
                ):
                    found[name] = " ".join(text.split())
    return found


def _unit(facts: Facts) -> str:
    given = [m.func.dimension.unit for m in facts.metadata if _converts(m)]
    given += [m.unit for m in facts.metadata if isinstance(m, Plausible) and m.unit]
    return (
        next((unit for unit in reversed(given) if unit), "").replace("^2", "²").replace("^3", "³")
    )


def _converts(one: Any) -> bool:
    return isinstance(one, BeforeValidator) and isinstance(one.func, Converter)


def _range(facts: Facts) -> str:
    parts = dict.fromkeys(filter(None, (_word(one) for one in facts.types)))
    if facts.sections:
        parts["a section, see below"] = None
    return ", ".join(filter(None, (facts.many, " or ".join(parts), _bounds(facts.metadata))))


def _word(kind: Any) -> str:
    if get_origin(kind) is Literal:
        return ", ".join(f"`{value}`" for value in get_args(kind))
    return {bool: "`true`, `false`", str: "text", int: "whole number"}.get(kind, "")


def _bounds(metadata: list[Any]) -> str:
    """The narrowest of the bounds, such as `> 0` and the range of what is plausible."""
    low, high = (-math.inf, True), (math.inf, True)  # each with whether it is allowed
    for bound in _all_bounds(metadata):
        match bound:
            case Gt(gt=value):
                low = max(low, (float(value), False), key=lambda b: (b[0], not b[1]))
            case Ge(ge=value):
                low = max(low, (float(value), True), key=lambda b: (b[0], not b[1]))
            case Lt(lt=value):
                high = min(high, (float(value), False))
            case Le(le=value):
                high = min(high, (float(value), True))
    at_least, at_most = _number(low[0]), _number(high[0])
    if low[0] == -math.inf:
        return "" if high[0] == math.inf else f"{'≤' if high[1] else '<'} {at_most}"
    if high[0] == math.inf:
        return f"{'≥' if low[1] else '>'} {at_least}"
    return f"{'' if low[1] else '> '}{at_least} … {'' if high[1] else '< '}{at_most}"


def _all_bounds(metadata: list[Any]) -> Iterator[Any]:
    for one in metadata:
        if isinstance(one, FieldInfo):
            yield from _all_bounds(one.metadata)
        elif isinstance(one, Plausible):
            yield from (Ge(one.least), Le(one.greatest))
        elif isinstance(one, Interval):
            yield from one
        else:
            yield one


def _number(value: float) -> str:
    if value.is_integer() and abs(value) < 1e6:
        return f"{int(value)}"
    return f"{value:.6g}".replace("e-0", "e-").replace("e+0", "e").replace("e+", "e")


def _default(value: Any) -> str:
    if value is REQUIRED:
        return "required"
    if value is None or value == () or _is_section(value):
        return ""
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    return _number(float(value)) if isinstance(value, int | float) else f"`{value}`"


def sections(
    model: type, path: str = "", within: tuple[type, ...] = ()
) -> Iterator[tuple[str, type]]:
    """All sections of a file with their places, each before those within it."""
    yield path, model
    for key in keys(model):
        place = f"{path}.{key.name}" if path else key.name
        place += {"by name": ".<name>", "list": "[]"}.get(key.facts.many, "")
        for section in key.facts.sections:
            if section not in (*within, model):
                yield from sections(section, place, (*within, model))


def page_of_file(title: str, model: type, guide: str) -> str:
    """The reference page of a kind of file."""
    lines = [
        f"# {title}: all keys",
        "",
        "Written by `python tools/reference.py` from the models that validate the file. "
        f"How the keys work together: [{guide.rpartition('/')[2]}](../{guide}).",
        "",
        "Numbers are in the unit given, or texts with another one of its kind (`80 um`). "
        "Ranges are what is accepted at all, some decades wider than any stage. "
        "An empty default: nothing is set.",
    ]
    found = list(sections(model))
    for section in dict.fromkeys(section for _, section in found):
        places = [at for at, other in found if other is section]
        name = ", ".join(f"`{place}`" for place in places) if places[0] else "The file"
        if sum(at == places[0] for at, _ in found) > 1:
            name += f": {_tag(section)}"
        lines += ["", f"## {name}", "", *_summary(section), ""]
        lines += ["| key | unit | range | default | |", "| --- | --- | --- | --- | --- |"]
        lines += [key.row() for key in keys(section)]
    return "\n".join(lines) + "\n"


def _tag(section: type) -> str:
    """What distinguishes a section from others in its place."""
    every = list(keys(section))
    source = next((key for key in every if key.name == "source"), None)
    if source is not None:
        return _range(source.facts)
    own = [key for key in every if key.default is REQUIRED]
    return f"`{own[0].name}`"


def _summary(section: type) -> list[str]:
    return [inspect.getdoc(section).split("\n\n")[0].replace("\n", " ")]  # type: ignore[union-attr]


def page_of_objects() -> str:
    """The objects that the host uses, and the object dictionary of the virtual drive."""
    virtual = canopen.import_od(str(EDS_PATH))
    used = sorted(
        (value for value in vars(objects).values() if isinstance(value, objects.ObjectRef)),
        key=lambda ref: (ref.index, ref.sub),
    )
    lines = [
        "# Object dictionary",
        "",
        "Written by `python tools/reference.py` from `drivers/objects.py` and the virtual drive's "
        "EDS.",
        "",
        "## What the host uses",
        "",
        "Of a drive's objects (CiA 301, CiA 402-2), beside those of its PDOs (0x1400 to 0x1BFF). "
        "Type and access are those of the virtual drive; of another one, those of its EDS.",
        "",
        "| object | name | type | access | counts |",
        "| --- | --- | --- | --- | --- |",
    ]
    for ref in used:
        there = virtual.get_variable(ref.index, ref.sub)
        kind, access = (_type(there), there.access_type) if there is not None else ("", "")
        counts = ref.quantity.name.lower() if ref.quantity else ""
        lines.append(
            f"| {_object(ref.index, ref.sub)} | {ref.name} | {kind} | {access} | {counts} |"
        )
    lines += [
        "",
        "## The virtual drive",
        "",
        "Defaults are those of its EDS; limits, gains and rated force follow the machine file.",
        "",
        "| object | name | type | access | default | PDO |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for entry in virtual.values():
        variables = [entry] if isinstance(entry, ODVariable) else list(entry.values())
        for one in variables:
            name = one.name if one is entry else f"{entry.name}: {one.name}"
            default = "" if one.default is None else f"{one.default}"
            cells = (name, _type(one), one.access_type, default, "yes" if one.pdo_mappable else "")
            lines.append(f"| {_object(one.index, one.subindex)} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def _object(index: int, sub: int) -> str:
    return f"0x{index:04X}:{sub:02X}"


def _type(variable: ODVariable) -> str:
    names = {
        value: name
        for name, value in vars(canopen.objectdictionary.datatypes).items()
        if name.isupper() and isinstance(value, int)
    }
    return names[variable.data_type]


PAGES: dict[str, Callable[[], str]] = {
    "machine.md": lambda: page_of_file("Machine files", Machine, "how-to/machine-file.md"),
    "recipe.md": lambda: page_of_file("Recipes", RecipeFile, "how-to/write-a-recipe.md"),
    "objects.md": page_of_objects,
}


def main() -> None:
    """Write them."""
    for name, made in PAGES.items():
        (FOLDER / name).write_text(made(), encoding="utf-8")


if __name__ == "__main__":
    main()
