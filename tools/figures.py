"""The index of docs/figures.md, from its sections: `python tools/figures.py`.

Tables and what they mean are put there by hand, from what the programs print; a section names the
command that prints its figures. tests/system/test_figures_page.py checks the page.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

PAGE = Path(__file__).parents[1] / "docs" / "figures.md"
BEGIN, END = "<!-- index -->\n", "<!-- /index -->\n"
_COMMAND = re.compile(r"`python -m\s(benchmarks\.[^`]+)`")


@dataclass(frozen=True)
class Section:
    """A heading and what stands below it, up to the next one.

    Attributes:
        title: its text.
        level: 2 or 3.
        text: below it.
    """

    title: str
    level: int
    text: str

    @property
    def commands(self) -> tuple[str, ...]:
        """Programs that it names, with their options, in its order."""
        return tuple(" ".join(each.split()) for each in _COMMAND.findall(self.text))

    @property
    def has_table(self) -> bool:
        """Whether it has a table of figures."""
        return "\n| ---" in self.text

    @property
    def anchor(self) -> str:
        """What links to it end with."""
        return re.sub(r"[^\w\- ]", "", self.title.lower()).replace(" ", "-")


def sections(page: str) -> list[Section]:
    """All sections of the page, its introduction left out."""
    parts = re.split(r"^(##+) (.*)$", page, flags=re.MULTILINE)[1:]
    return [
        Section(title, len(marks), text)
        for marks, title, text in zip(parts[::3], parts[1::3], parts[2::3], strict=True)
    ]


def with_index(page: str) -> str:
    """The page with the index of its sections."""
    rows = ["| figures | printed by `python -m` |", "| --- | --- |"]
    for section in sections(page):
        programs = dict.fromkeys(f"`{each.split()[0]}`" for each in section.commands)
        indent = "... " if section.level > 2 else ""
        link = f"[{section.title}](#{section.anchor})"
        rows.append(f"| {indent}{link} | {', '.join(programs)} |")
    begin, rest = page.split(BEGIN)
    return begin + BEGIN + "\n".join(rows) + "\n" + END + rest.split(END)[1]


def main() -> None:
    """Write it."""
    PAGE.write_text(with_index(PAGE.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
