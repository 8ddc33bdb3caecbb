"""The pages that explain the files: their examples load, and no key goes unexplained."""

import re
from pathlib import Path
from typing import get_args

import pytest
from pydantic import BaseModel

from stagectl.config import Machine, load_machine, parse_machine
from stagectl.recipe.plan import plan
from stagectl.recipe.schema import RecipeFile

DOCS = Path(__file__).parents[4] / "docs"


def examples(page):
    return re.findall(r"```yaml\n(.*?)```", (DOCS / page).read_text(encoding="utf-8"), re.DOTALL)


def test_the_recipe_pages_examples_load(recipe_of):
    whole, sites, moves = examples("how-to/write-a-recipe.md")
    assert len(recipe_of(whole).sites) == 20
    head = "".join(line for line in whole.splitlines(True) if not line.startswith("sites"))
    for line in sites.splitlines():
        if "file" not in line:
            assert plan(recipe_of(head + line))
    assert len(recipe_of(head + moves).moves) == 6


def test_the_machine_pages_example_is_the_packaged_machine():
    (example,) = examples("how-to/machine-file.md")
    machine = parse_machine(example.replace("  y: ...\n", ""), "machine.md")
    packaged = load_machine()
    assert machine.bus == packaged.bus
    assert machine.axes["x"] == packaged.axes["x"]


def keys(annotation):
    """Every key that a model takes, at any depth."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        for name, info in annotation.model_fields.items():
            yield info.alias or name
            if annotation.__name__ != "RepeatItem":  # it holds the others
                yield from keys(info.annotation)
    for argument in get_args(annotation):
        yield from keys(argument)


@pytest.mark.parametrize(
    ("page", "model"), [("reference/recipe.md", RecipeFile), ("reference/machine.md", Machine)]
)
def test_every_key_is_explained(page, model):
    words = set(re.findall(r"\w+", (DOCS / page).read_text(encoding="utf-8")))
    expected = set(keys(model))
    assert len(expected) > 20
    assert expected - words == set()
