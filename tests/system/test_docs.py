"""The docs are true: files that they link to exist, and names that they import.

Their commands are followed by `make docs-check`.
"""

import importlib
import re
import tomllib
from pathlib import Path

import pytest

from tools import docs_commands, reference

ROOT = Path(__file__).parents[2]
PAGES = [
    *ROOT.glob("*.md"),
    *(ROOT / "docs").rglob("*.md"),
    *(ROOT / "benchmarks").glob("*.md"),
]


def anchors(page):
    """Headings of a page, as GitHub names them in links."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_link_leads_somewhere(page):
    links = re.findall(r"\]\((?!https?:)([^)#\s]*)#?([^)\s]*)\)", page.read_text(encoding="utf-8"))
    for file, anchor in links:
        target = page.parent / file if file else page
        assert target.exists(), file
        assert not anchor or anchor in anchors(target), f"{file}#{anchor}"


def test_every_import_in_an_example_works():
    """Names in `from X import Y` of our own packages."""
    found = [
        (page.name, module, name)
        for page in PAGES
        for block in re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
        for module, names in re.findall(r"^from ([\w.]+) import ([\w, ]+)", block, re.MULTILINE)
        for name in names.split(", ")
    ]
    assert found
    wrong = [f for f in found if not hasattr(importlib.import_module(f[1]), f[2])]
    assert wrong == []


def test_every_test_that_guards_against_a_pitfall_exists():
    """In the last column: files, `same` for that of the row before, and parts of tests' names."""
    tests, missing, last = ROOT / "tests", [], []
    text = (ROOT / "docs" / "explanation" / "pitfalls.md").read_text(encoding="utf-8")
    rows = [line for line in text.splitlines() if line.startswith("| ") and "---" not in line]
    for row in rows:
        cell, files = row.rstrip(" |").rsplit(" | ", 1)[-1], []
        for word in re.findall(r"`([^`]+)`|\bsame\b", cell):
            if not word:
                files += last
            elif word.endswith((".py", "/")):
                files.append(tests / word)
                missing += [] if files[-1].exists() else [word]
            elif re.fullmatch(r"[a-z]\w*_\w+", name := word.rstrip(".")):
                code = "".join(f.read_text(encoding="utf-8") for f in files or last if f.is_file())
                missing += [] if re.search(rf"def test_\w*{name}", code) else [word]
        last = files or last
    assert len(rows) > 40
    assert missing == []


def test_a_block_of_commands_is_followed_or_says_why_not():
    marked = {page.name: docs_commands.blocks(page.read_text("utf-8")) for page in PAGES}
    assert len(marked["diagnose.md"]) > 5
    with pytest.raises(docs_commands.WrongDocsError, match="line 2: unknown comment before it: no"):
        docs_commands.blocks("<!-- no -->\n```console\n$ true\n```\n")
    (block,) = docs_commands.blocks("<!-- exit 3 -->\n```console\n$ true\n```\n")
    assert block.mark == "exit 3"


@pytest.mark.parametrize("name", reference.PAGES)
def test_the_reference_is_what_the_program_has(name):
    page = (reference.FOLDER / name).read_text(encoding="utf-8")
    assert page == reference.PAGES[name](), "python tools/reference.py writes it anew"


def test_the_reference_has_every_key():
    text = (reference.FOLDER / "machine.md").read_text(encoding="utf-8")
    for key in (
        "sync_period",
        "following_error_time",
        "revision",
        "lock_memory",
        "position_filter",
    ):
        assert text.count(f"| `{key}` |") == 1, key
    assert "| `sync_period` | s | > 0 … 1 | required |" in text
    assert "| `heartbeat` | s | 0.01 … 1 | 0.1 |" in text


def test_the_version_is_the_same_wherever_it_stands():
    text = (ROOT / "CHANGELOG.md").read_text("utf-8")
    first = re.search(r"^## (\S+)", text, re.MULTILINE)[1].strip("[]")
    cited = re.search(r"^version: (\S+)$", (ROOT / "CITATION.cff").read_text("utf-8"), re.MULTILINE)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["version"]
    assert project == cited[1]
    assert first in (project, "Unreleased")


FIRST = (ROOT / "docs" / "tutorials" / "first-effect.md").read_text("utf-8")


def test_the_first_tutorial_takes_few_commands():
    typed = [c for b in docs_commands.blocks(FIRST) for c in docs_commands.commands(FIRST, b)]
    assert 5 < len(typed) <= 12


PRINTED = "x: mass 8.0 -> 7.9992 kg, ±446, 20 sites, node 2 at 0x6041"


@pytest.mark.parametrize(
    ("printed", "is_quoted"),
    [
        ("x: mass  8.000 -> 7.9 kg, ±431, 20 sites, node 2 at 0x6041", True),
        ("x: mass 8.0 -> 5.9 kg, ±446, 20 sites, node 2 at 0x6041", False),
        ("x: mass 8.0 -> 7.9992 kg, ±446, 21 sites, node 2 at 0x6041", False),
        ("x: mass 8.0 -> 7.9992 kg, ±446, 20 sites, node 3 at 0x6041", False),
        ("x: mass 8.0 -> 7.9992 kg, ±446, 20 sites, node 2 at 0x6042", False),
        ("y: mass 8.0 -> 7.9992 kg, ±446, 20 sites, node 2 at 0x6041", False),
    ],
)
def test_only_figures_may_differ_and_by_little(printed, is_quoted):
    command = docs_commands.Command("cat", range(1), (PRINTED,))
    assert (command.corrected([printed]) == [PRINTED]) is is_quoted
