"""What a room offers says shapes, units, errors and sources where it has any.

Offered is what the `__init__` of a room imports for others, and what docs/reference/python.md
names. Of classes, their public methods are looked at, too, also those that they inherit. A module
may name the source of an equation or object for all of its functions.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import re
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = ("drivers", "estimation", "hil_sim", "sim2real", "stagectl", "stagedata")
SHAPE = re.compile(r"\w+\[[^\]]+\]|(?i:shape|same (shape|length))|\[[A-Z](, \w+)*\]")
UNIT = re.compile(
    r"\[[^\]]*\b(m|s|ms|ns|us|N|kg|Hz|rad|deg C|bit|counts?|increments|rated|day)\b[^\]]*\]|°C|"
    r"\b(SI|units?|seconds?|samples?|SYNCs|share|ratio|[Rr]elative|probability|over|factor|days)\b"
)
SOURCE = re.compile(r"CiA 30[13]|equation \(\d|CiA 402|0x[0-9A-F]{4}|docs/\w+|\b(19|20)\d\d\b")
"""A standard or object, a page of the docs, or literature."""
OBJECTS_AND_EQUATIONS = (
    "drivers.drive", "drivers.motion", "hil_sim.cia402", "hil_sim.cia301", "hil_sim.plant",
    "estimation.friction", "estimation.online", "estimation.observer", "estimation.field",
    "sim2real.tracking", "sim2real.free_loop", "sim2real.scoring", "sim2real.rivals",
)  # fmt: skip
"""Rooms that implement equations, or objects of the drives' dictionary."""
NO_EQUATIONS = {
    "estimation.online.estimate", "estimation.online.settings", "hil_sim.plant.arrays",
    "hil_sim.plant.ports.port_arrays",
}  # fmt: skip
"""Modules of these rooms that only hold what others compute."""


def _offered():
    """(module, name) of every class and function that a room offers."""
    found = set()
    for package in PACKAGES:
        for room in (ROOT / package).rglob("__init__.py*"):
            if room.suffix not in (".py", ".pyi"):
                continue
            here = ".".join(room.parent.relative_to(ROOT).parts)
            for node in ast.parse(room.read_text("utf-8")).body:
                if isinstance(node, ast.ImportFrom) and node.module:
                    module = f"{here}.{node.module}" if node.level else node.module
                    found |= {
                        (module, name.name)
                        for name in node.names
                        if room.suffix == ".pyi" or name.asname == name.name
                    }
    page = (ROOT / "docs" / "reference" / "python.md").read_text("utf-8")
    for kind, name in re.findall(r"auto(class|function|module):: ([\w.]+)", page):
        if kind == "module":
            tree = _tree(name)
            found |= {(name, n.name) for n in tree.body if _is_public(n)}
        else:
            found.add(tuple(name.rpartition(".")[::2]))
    return found


@cache
def _tree(module):
    return ast.parse(
        Path(inspect.getsourcefile(importlib.import_module(module))).read_text("utf-8")
    )


def _is_public(node):
    kinds = (ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    return isinstance(node, kinds) and not node.name.startswith("_")


@cache
def _functions():
    """(module, name, function, docstring of its class) of all that is offered."""
    done = {}
    for module, name in sorted(_offered()):
        if module.partition(".")[0] not in PACKAGES:
            continue
        thing = getattr(importlib.import_module(module), name)
        module = getattr(thing, "__module__", None) or module  # where it is defined
        if not inspect.isclass(thing) and not inspect.isroutine(thing):
            continue
        node = next((n for n in _tree(module).body if getattr(n, "name", None) == name), None)
        if isinstance(node, ast.ClassDef):
            for base in _own_classes(thing):
                of_class = ast.get_docstring(base) or ""
                for inner in filter(_is_public, base.body):
                    done.setdefault(f"{module}.{name}.{inner.name}", (module, inner, of_class))
        elif node is not None:
            done[f"{module}.{name}"] = (module, node, "")
    return done


def _own_classes(thing):
    """A class and those of this project that it inherits from."""
    for base in inspect.getmro(thing):
        if base.__module__.partition(".")[0] in PACKAGES:
            yield next(
                n for n in _tree(base.__module__).body if getattr(n, "name", None) == base.__name__
            )


def _annotations(function):
    a = function.args
    every = [*a.posonlyargs, *a.args, *a.kwonlyargs]
    return [ast.unparse(one.annotation) for one in every if one.annotation] + (
        [ast.unparse(function.returns)] if function.returns else []
    )


def test_there_are_functions_to_look_at():
    assert len(_functions()) > 150
    assert "drivers.stage.stage.Stage.stream" in _functions()


def _lacks(function, of_class):
    """What a docstring lacks of shapes and units."""
    text, kinds = f"{ast.get_docstring(function) or ''} {of_class}", _annotations(function)
    arrays = any(re.search(r"\b(F64|NDArray|ndarray)\b", kind) for kind in kinds)
    lacks = ["shape"] if arrays and not SHAPE.search(text) else []
    if (arrays or any(re.search(r"\bfloat\b", kind) for kind in kinds)) and not UNIT.search(text):
        lacks.append("unit")
    return lacks


def _unnamed_errors(function, of_class):
    """Errors of the project that a function raises itself, and that are not under Raises."""
    named = f"{ast.get_docstring(function) or ''} {of_class}".partition("Raises:")[2]
    raised = {
        ast.unparse(node.exc.func).rpartition(".")[2]
        for node in ast.walk(function)
        if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call)
    }
    return sorted(error for error in raised & _project_errors() if error not in named)


@cache
def _project_errors():
    return {
        node.name
        for package in PACKAGES
        for path in (ROOT / package).rglob("errors.py")
        for node in ast.parse(path.read_text("utf-8")).body
        if isinstance(node, ast.ClassDef)
    }


def test_arrays_have_shapes_and_figures_units():
    found = {name: _lacks(f, of_class) for name, (_, f, of_class) in _functions().items()}
    assert {name: lacks for name, lacks in found.items() if lacks} == {}


def test_errors_that_are_raised_are_named():
    found = {name: _unnamed_errors(f, of_class) for name, (_, f, of_class) in _functions().items()}
    assert {name: errors for name, errors in found.items() if errors} == {}


def test_equations_and_objects_have_a_source():
    without = []
    for module in {m for m, _, _ in _functions().values() if m.startswith(OBJECTS_AND_EQUATIONS)}:
        tree = _tree(module)
        texts = [ast.get_docstring(n) or "" for n in (tree, *filter(_is_public, tree.body))]
        if not SOURCE.search(" ".join(texts)):
            without.append(module)
    assert set(without) == NO_EQUATIONS


@pytest.mark.parametrize(
    ("text", "lacks", "errors"),
    [
        ("The force.", ["shape", "unit"], ["LimitError"]),
        ("The force float64[K] at a speed.", ["unit"], ["LimitError"]),
        ("The force float64[K] [N].\n\n    Raises:\n        LimitError: too much.", [], []),
    ],
)
def test_the_rules_find_what_is_missing(text, lacks, errors):
    body = f'"""{text}"""\n    raise LimitError("no")'
    (function,) = ast.parse(f"def force(speed: float) -> F64:\n    {body}").body
    assert _lacks(function, "") == lacks
    assert _unnamed_errors(function, "") == errors
