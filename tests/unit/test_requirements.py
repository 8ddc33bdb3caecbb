"""What `make` installs is locked, and is what pyproject.toml asks for."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
GROUPS = PROJECT["dependency-groups"]
EXTRAS = PROJECT["project"]["optional-dependencies"]
RUN = [*PROJECT["project"]["dependencies"], *PROJECT["build-system"]["requires"], *GROUPS["build"]]
DEV = [*(r for extra in EXTRAS.values() for r in extra), *GROUPS["dev"]]


def blocks(file):
    """Each requirement with its hashes."""
    text = (ROOT / "requirements" / file).read_text()
    for block in re.split(r"\n(?=\S)", "\n" + re.sub(r"(?m)^\s*#.*\n?", "", text)):
        if block.strip():
            yield block.strip()


@pytest.mark.parametrize(
    ("file", "asked"),
    [("run.txt", RUN), ("console.txt", EXTRAS["console"]), ("dev.txt", RUN + DEV)],
)
def test_every_requirement_is_locked_within_its_bounds(file, asked):
    locked = dict[str, list[str]]()
    for block in blocks(file):
        name, _, version = block.split(" ")[0].partition("==")
        locked.setdefault(canonicalize_name(name), []).append(version)
    for text in (a for a in asked if isinstance(a, str)):
        wanted = Requirement(text)
        versions = locked[canonicalize_name(wanted.name)]
        assert any(wanted.specifier.contains(version) for version in versions), text


@pytest.mark.parametrize("file", ["run.txt", "console.txt", "dev.txt", "mutants.txt"])
def test_everything_has_hashes_and_nothing_an_address(file):
    assert "://" not in (ROOT / "requirements" / file).read_text()
    for block in blocks(file):
        assert re.match(r"[\w.\[\]-]+==\S+", block), block
        assert "--hash=sha256:" in block, block


def test_the_console_takes_the_versions_that_tests_have():
    of_tests = {block.split(" ")[0] for block in blocks("dev.txt")}
    assert {block.split(" ")[0] for block in blocks("console.txt")} <= of_tests
