"""What a room offers lazily means the same with every version of lazy-loader that is allowed."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
LAZY = [
    stub
    for package in ("drivers", "estimation", "hil_sim", "sim2real", "stagectl", "stagedata")
    for stub in sorted((ROOT / package).rglob("__init__.pyi"))
]


@pytest.mark.parametrize("stub", LAZY, ids=lambda stub: str(stub.parent.relative_to(ROOT)))
def test_no_offered_name_is_that_of_a_module(stub):
    """Importing the module would put it in the name's place."""
    imports = [
        node
        for node in ast.parse(stub.read_text()).body
        if isinstance(node, ast.ImportFrom) and node.module  # else modules themselves are offered
    ]
    offered = {name.asname or name.name for node in imports for name in node.names}
    inside = {path.stem for path in stub.parent.iterdir() if path.suffix in ("", ".py")}
    assert offered
    assert not offered & inside
