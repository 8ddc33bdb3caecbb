"""What a room offers says shapes, units, errors and sources where it has any.

Offered is what the `__init__` of a package imports for others, and what docs/reference/python.md
names. Of classes, their public methods are looked at, too; of an equation, its module may name the
source for all of its functions.
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
    r"\[[^\]]*(m|s|N|kg|Hz|rad|°C|deg C|bit|1|counts?|%|permille|‰)[^\]]*\]|[0-9] ?(ms|s|µs|us|nm|m|N|Hz)\b"
    r"|\b(SI|seconds?|metres?|samples?|SYNCs|share|ratio|relative|probability|over|fraction|factor|units?|days)\b"
)
SOURCE = re.compile(r"CiA|0x[0-9A-F]{4}|equation|eq\. |\bpaper|docs/|decision|[A-Z]\w+('s)? (19|20)\d\d")
OBJECTS_AND_EQUATIONS = (
    "drivers.drive", "drivers.motion", "hil_sim.cia402", "hil_sim.cia301", "hil_sim.plant",
    "estimation.friction", "estimation.online", "estimation.observer", "estimation.field",
)  # fmt: skip
"""Rooms that implement equations, or objects of the drives' dictionary."""


def _offered():
    """(module, name) of every class and function that a room offers."""
    found = set()
    for package in PACKAGES:
        for room in (ROOT / package).rglob("__init__.py*"):
            if room.suffix not in (".py", ".pyi"):
                continue
            here = ".".join(room.parent.relative_to(ROOT).parts)
            for node in ast.parse(room.read_text("utf-8")).body:
                if isinstance(node, ast.ImportFrom):
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
    return ast.parse(Path(inspect.getsourcefile(importlib.import_module(module))).read_text("utf-8"))


def _is_public(node):
    kinds = (ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    return isinstance(node, kinds) and not node.name.startswith("_")


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
            of_class = ast.get_docstring(node) or ""
            for inner in filter(_is_public, node.body):
                done[f"{module}.{name}.{inner.name}"] = (module, inner, of_class)
        elif node is not None:
            done[f"{module}.{name}"] = (module, node, "")
    return done


FUNCTIONS = _functions()


def _annotations(function):
    a = function.args
    every = [*a.posonlyargs, *a.args, *a.kwonlyargs]
    return [ast.unparse(one.annotation) for one in every if one.annotation] + (
        [ast.unparse(function.returns)] if function.returns else []
    )


def test_there_are_functions_to_look_at():
    assert len(FUNCTIONS) > 150
    assert "drivers.stage.Stage.stream" in FUNCTIONS


@pytest.mark.parametrize("name", FUNCTIONS)
def test_arrays_have_shapes_and_figures_units(name):
    _, function, of_class = FUNCTIONS[name]
    text, kinds = f"{ast.get_docstring(function) or ''} {of_class}", _annotations(function)
    if any(re.search(r"\b(F64|NDArray|ndarray)\b", kind) for kind in kinds):
        assert SHAPE.search(text), f"no shape: {text}"
        assert UNIT.search(text), f"no unit: {text}"
    elif any(re.search(r"\bfloat\b", kind) for kind in kinds):
        assert UNIT.search(text), f"no unit: {text}"


@cache
def _project_errors():
    return {
        node.name
        for package in PACKAGES
        for path in (ROOT / package).rglob("errors.py")
        for node in ast.parse(path.read_text("utf-8")).body
        if isinstance(node, ast.ClassDef)
    }


@pytest.mark.parametrize("name", FUNCTIONS)
def test_errors_that_are_raised_are_named(name):
    _, function, of_class = FUNCTIONS[name]
    text = f"{ast.get_docstring(function) or ''} {of_class}"
    for node in ast.walk(function):
        if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call):
            error = ast.unparse(node.exc.func).rpartition(".")[2]
            if error in _project_errors():
                assert error in text.partition("Raises:")[2], f"{error} is not under Raises"


@pytest.mark.parametrize(
    "module", sorted({m for m, _, _ in FUNCTIONS.values() if m.startswith(OBJECTS_AND_EQUATIONS)})
)
def test_equations_and_objects_have_a_source(module):
    tree = _tree(module)
    texts = [ast.get_docstring(tree)] + [ast.get_docstring(n) for n in tree.body if _is_public(n)]
    assert SOURCE.search(" ".join(filter(None, texts)))
