"""docs/figures.md: every table names the program that prints it, with options that it has."""

import importlib
import re
import sys

import pytest

from tools import figures

PAGE = figures.PAGE.read_text(encoding="utf-8")
SECTIONS = figures.sections(PAGE)
ROOT = figures.PAGE.parents[1]


def test_the_index_is_of_its_sections():
    assert figures.with_index(PAGE) == PAGE, "python tools/figures.py writes it anew"


def test_it_says_where_figures_were_measured():
    assert "2 shared x86-64 cores, CPython 3.11" in " ".join(PAGE.partition("<!--")[0].split())


@pytest.mark.parametrize("section", SECTIONS, ids=lambda section: section.anchor)
def test_a_section_with_a_table_names_a_program(section):
    assert section.commands or not section.has_table


@pytest.mark.parametrize("command", sorted({c for s in SECTIONS for c in s.commands}))
def test_a_program_has_the_options_that_are_named(command, monkeypatch, capsys):
    name, *options = command.split()
    monkeypatch.setattr(sys, "argv", [name, "--help"])
    with pytest.raises(SystemExit):
        importlib.import_module(name).main()
    known = capsys.readouterr().out
    for option in re.findall(r"--[\w-]+", " ".join(options)):
        assert re.search(rf"{option}\b", known), option


def test_a_program_whose_figures_the_list_of_programs_looks_for_there_is_named_there():
    named = {s.anchor: " ".join(s.commands) for s in SECTIONS}
    rows = (ROOT / "benchmarks" / "README.md").read_text(encoding="utf-8")
    listed = re.findall(r"^\| `([\w.]+)`.*\(\.\./docs/figures\.md#([\w-]+)\)", rows, re.MULTILINE)
    assert len(listed) > 25
    assert [n for n, anchor in listed if f"benchmarks.{n}" not in named[anchor]] == []


def test_a_section_is_found_with_its_programs():
    (section,) = figures.sections(
        "intro\n## Two words\n`python -m benchmarks.a\n--b 2`\n\n| --- |\n"
    )
    assert (section.anchor, section.commands) == ("two-words", ("benchmarks.a --b 2",))
    assert section.has_table
