"""Counts what a reader has to read: `python tools/size.py`, with --list for the names.

A code line carries a token that is neither comment nor docstring. A long function has more than 60
lines from `def` to its end; one of many arguments more than 8, self and keyword-only ones included.
"""

from __future__ import annotations

import ast
import io
import sys
import tokenize
from collections.abc import Iterator
from pathlib import Path

PACKAGES = ("stagectl", "drivers", "estimation", "hil_sim", "sim2real", "stagedata")
OTHERS = ("tests", "benchmarks", "tools")
LONG = 60
MANY = 8
LAYOUT = (tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER)

Function = ast.FunctionDef | ast.AsyncFunctionDef


def code_lines(path: Path) -> int:
    """Lines that are neither blank, comment nor docstring."""
    source = path.read_text(encoding="utf-8")
    lines: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type not in (tokenize.COMMENT, *LAYOUT):
            lines.update(range(token.start[0], token.end[0] + 1))
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            if isinstance(node.value.value, str):
                lines.difference_update(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return len(lines)


def functions(folder: str) -> Iterator[tuple[str, int, int]]:
    """Name with place, lines, arguments."""
    for path in sorted(Path(folder).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, Function):
                args = node.args
                lines = (node.end_lineno or node.lineno) - node.lineno + 1
                count = len(args.posonlyargs) + len(args.args) + len(args.kwonlyargs)
                yield f"{path}:{node.lineno} {node.name}", lines, count


def main() -> None:
    """Print the counts."""

    def size(folder: str) -> int:
        return sum(map(code_lines, Path(folder).rglob("*.py")))

    sizes = {folder: size(folder) for folder in (*PACKAGES, *OTHERS)}
    for folder, lines in sizes.items():
        print(f"{lines:7} {folder}")
    print(f"{sum(sizes[folder] for folder in PACKAGES):7} packages, {len(PACKAGES)} of them")
    found = [each for folder in PACKAGES for each in functions(folder)]
    long = [f"{name}, {lines} lines" for name, lines, _ in found if lines > LONG]
    many = [f"{name}, {count} arguments" for name, _, count in found if count > MANY]
    for title, names in ((f"lines > {LONG}", long), (f"arguments > {MANY}", many)):
        print(f"{len(names):7} functions, {title}")
        if "--list" in sys.argv:
            print(*(f"        {name}" for name in names), sep="\n")


if __name__ == "__main__":
    main()
