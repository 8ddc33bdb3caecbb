"""Measures the docs' sentences: `python tools/sentences.py [PAGE...]`, with --list the long ones.

Per page: sentences, mean and longest in words. Without pages: README, CHANGELOG and docs.
Code blocks, tables, quotes, comments, headings (those in bold that begin a paragraph, too) and the
targets of links do not count; inline code is one word. A paragraph or list item ends a sentence, a
colon or semicolon does not.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

PAGES = ("README.md", "CHANGELOG.md", "docs/*.md", "docs/*/*.md")
LONG = 30
NO_PROSE = re.compile(
    r"^ *```.*?^ *```$|<!--.*?-->|^ *[|>].*?$|^#.*?$|(?<=\n\n) {4}.*?(?=\n\n|\Z)",
    re.MULTILINE | re.DOTALL,
)
PARAGRAPH = re.compile(r"\n\s*\n|\n(?= *(?:[-*]|\d+\.) )")
LIST_MARK = re.compile(r"^\s*(?:[-*]|\d+\.) ")
HEAD = re.compile(r"^\*\*[^*]+[.?!]\*\*")
SENTENCE_END = re.compile(r"(?<=[.?!])[*)\"]*\s+(?![a-z])")


def sentences(text: str) -> list[str]:
    """The sentences of a page in Markdown."""
    prose = NO_PROSE.sub("\n\n", text)
    prose = re.sub(r"`[^`]+`", "`code`", prose)
    prose = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", prose)
    paragraphs = (HEAD.sub("", LIST_MARK.sub("", each)) for each in PARAGRAPH.split(prose))
    found = (each for paragraph in paragraphs for each in SENTENCE_END.split(paragraph))
    return [" ".join(each.split()) for each in found if words(each)]


def words(sentence: str) -> int:
    """Words and numbers, signs that stand alone left out."""
    return sum(any(map(str.isalnum, word)) for word in sentence.split())


def main() -> None:
    """Print the lengths."""
    named = [Path(each) for each in sys.argv[1:] if each != "--list"]
    print("sentences  mean  longest")
    for page in named or [page for pattern in PAGES for page in sorted(Path().glob(pattern))]:
        found = sentences(page.read_text(encoding="utf-8"))
        lengths = [words(each) for each in found] or [0]
        print(f"{len(found):9} {sum(lengths) / len(lengths):5.1f} {max(lengths):8}  {page}")
        if "--list" in sys.argv:
            print(*(f"    {words(each)}: {each}\n" for each in found if words(each) > LONG), sep="")


if __name__ == "__main__":
    main()
