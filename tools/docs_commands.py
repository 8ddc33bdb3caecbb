"""The command blocks of the docs, followed as a reader would: in order, in a copy of the clone.

    python tools/docs_commands.py check [PAGE...]    compares what they print with what is quoted
    python tools/docs_commands.py quotes [PAGE...]   quotes what they print

Without pages: README.md, docs/*.md, and those of docs/tutorials, docs/how-to and docs/explanation.
A comment on the line before a block says what is special:

    <!-- not run: REASON -->   it needs hardware, or data that are not here
    <!-- exit CODE -->         its last command ends with another exit code than 0
    <!-- until Ctrl-C -->      its last command goes on; Ctrl-C once it has printed what is quoted
    <!-- file: NAME -->        no commands: a file of the reader's

Words and counts have to be as quoted. Figures may be a little off, as processors round differently:
a recording then differs in its last digits, and all that is computed from it. `...` within a quoted
line stands for what differs more from machine to machine, a line of it alone (one in a quote, and
more after it) for any lines. A command without a quote may print what it likes.
`make test` is not run: it comes after this. `make run` installs nothing: CI has just done that.
"""

from __future__ import annotations

import argparse
import difflib
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGES = [
    ROOT / "README.md",
    *sorted((ROOT / "docs").glob("*.md")),
    *sorted((ROOT / "docs" / "tutorials").glob("*.md")),
    *sorted((ROOT / "docs" / "how-to").glob("*.md")),
    *sorted((ROOT / "docs" / "explanation").glob("*.md")),
]
_KNOWN = r"|not run: .+|exit \d+|until Ctrl-C|file: \S+"
NOT_RUN = ("make test",)
INSTALLED = ".installed"
NOT_COPIED = shutil.ignore_patterns(
    ".git", ".venv*", ".*_cache", "__pycache__", "_build", "runs", "mutants"
)


class WrongDocsError(Exception):
    """A block that cannot be followed."""


@dataclass(frozen=True)
class Block:
    """A block of commands, or a file of the reader's.

    Attributes:
        lines: numbers of its lines within the page, the fences excluded.
        mark: what the comment before it says; "" without one.
    """

    lines: range
    mark: str

    @property
    def file(self) -> str | None:
        """Its name, where the block is a file."""
        return self.mark.removeprefix("file: ") if self.mark.startswith("file: ") else None


@dataclass(frozen=True)
class Command:
    """A command, and where on its page it is quoted.

    Attributes:
        text: what is typed.
        quote: numbers of the lines quoted of its output; empty where the docs quote none.
        quoted: those lines.
    """

    text: str
    quote: range
    quoted: tuple[str, ...]

    def corrected(self, printed: list[str]) -> list[str]:
        """What to quote instead: as it is where it agrees with what was printed."""
        if not self.quoted:
            return []
        stripped = [line.strip() for line in self.quoted]
        if "..." not in stripped:
            return _corrected(self.quoted, printed)
        cut = stripped.index("...")
        head, tail = self.quoted[:cut], self.quoted[cut + 1 :]
        after = [n for n in range(cut, len(printed)) if _stands_for(tail[0], printed[n])]
        resumed = after[0] if after else cut
        return [
            *_corrected(head, printed[:cut]),
            self.quoted[cut],
            *_corrected(tail, printed[resumed:]),
        ]


def blocks(text: str) -> list[Block]:
    """Blocks of a page that are commands or files, those that are not run left out.

    Raises:
        WrongDocsError: the comment before a block is none of those above.
    """
    found, mark, begin, wanted = list[Block](), "", 0, False
    for number, line in enumerate(text.splitlines()):
        if begin:
            if line == "```":
                if wanted and not mark.startswith("not run: "):
                    found.append(Block(range(begin, number), mark))
                begin, mark = 0, ""
        elif line.startswith("```"):
            if not re.fullmatch(_KNOWN, mark):
                raise WrongDocsError(f"line {number + 1}: unknown comment before it: {mark}")
            begin, wanted = number + 1, line == "```console" or mark.startswith("file: ")
        elif comment := re.fullmatch(r"<!-- (.*) -->", line):
            mark = comment[1]
        elif line:
            mark = ""
    return found


def commands(text: str, block: Block) -> Iterator[Command]:
    """The commands of a block."""
    lines = text.splitlines()
    starts = [n for n in block.lines if lines[n].startswith("$ ")]
    for start, end in zip(starts, [*starts[1:], block.lines.stop], strict=True):
        quote = range(start + 1, end)
        yield Command(lines[start][2:], quote, tuple(lines[n] for n in quote))


@contextmanager
def copy_of_the_clone() -> Iterator[Path]:
    """A folder in which a reader would follow a page."""
    with tempfile.TemporaryDirectory(prefix="docs-") as name:
        clone = shutil.copytree(ROOT, Path(name, "clone"), ignore=NOT_COPIED, symlinks=True)
        (clone / INSTALLED).touch()
        yield clone


def follow(text: str, folder: Path) -> Iterator[tuple[Command, list[str]]]:
    """Run the commands of a page in its order.

    Args:
        text: of the page.
        folder: where.

    Yields:
        Each command, and the lines that it printed.

    Raises:
        WrongDocsError: a command ended with another exit code than the docs say.
    """
    for block in blocks(text):
        if block.file is not None:
            lines = text.splitlines()[block.lines.start : block.lines.stop]
            (folder / block.file).write_text("".join(f"{line}\n" for line in lines))
            continue
        typed = list(commands(text, block))
        for command in typed:
            if command.text.split("#")[0].strip() in NOT_RUN:
                continue
            last = command is typed[-1]
            yield command, _run(command, folder, block.mark if last else "")


def _run(command: Command, folder: Path, mark: str) -> list[str]:
    """What a command prints, without spaces at the ends of lines."""
    home = folder.parent / "home"
    home.mkdir(exist_ok=True)
    here = Path(sys.executable).parent
    environment = {
        "PATH": f"{here}{os.pathsep}{os.environ['PATH']}",
        "MAKEFLAGS": f"-- BIN={here} INSTALLED={INSTALLED}",
        "HOME": str(home), "LANG": "C.UTF-8", "COLUMNS": "100", "NO_COLOR": "1",
        **{k: v for k, v in os.environ.items() if k.startswith(("CAN_CONFIG", "NUMBA_", "PIP_"))},
    }  # fmt: skip
    with subprocess.Popen(
        ["bash", "-o", "pipefail", "-c", command.text],
        cwd=folder, env=environment, encoding="utf-8",
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    ) as process:  # fmt: skip
        output = iter(process.stdout or ())
        printed = []
        if mark == "until Ctrl-C":
            printed = [next(output, "") for _ in command.quoted]
            process.send_signal(signal.SIGINT)
        printed += output
    expected = int(mark.split()[1]) if mark.startswith("exit ") else 0
    if process.returncode != expected:
        raise WrongDocsError(
            f"$ {command.text}\nended with {process.returncode}, not {expected}:\n"
            + "".join(printed)
        )
    lines = [line.rstrip() for line in printed]
    while lines and not lines[-1]:
        lines.pop()
    return lines


_FIGURE = re.compile(r"(?<![\w.])\d+(?:\.\d+)?(?!\w)")
DECIMAL, WHOLE, DIGITS = 0.2, 0.04, 2
"""By so much of itself a decimal figure may be off, or by so many units of its last digit; and a
whole one, so that counts below 25 have to be as quoted."""


def _stands_for(quoted: str, printed: str) -> bool:
    quoted, printed = " ".join(quoted.split()), " ".join(printed.split())
    figures = _FIGURE.findall(quoted.replace("...", " "))
    words = (_FIGURE.split(part) for part in quoted.split("..."))
    parts = (r"(\d+(?:\.\d+)?)".join(map(re.escape, part)) for part in words)
    found = re.fullmatch(".+".join(parts), printed)
    return found is not None and all(map(_agree, figures, found.groups()))


def _agree(quoted: str, printed: str) -> bool:
    """Whether two figures are the same but for how processors round."""
    first, second = float(quoted), float(printed)
    off, largest = abs(first - second), max(first, second)
    if quoted.isdigit() and printed.isdigit():
        return off <= WHOLE * largest
    digits = min(len(figure.partition(".")[2]) for figure in (quoted, printed))
    return off <= max(DECIMAL * largest, (DIGITS + 1e-6) * 10.0**-digits)


def _corrected(quoted: Sequence[str], printed: Sequence[str]) -> list[str]:
    """The printed lines, those that the quoted ones stand for as quoted."""
    pairs = zip_longest(quoted[: len(printed)], printed, fillvalue="")
    return [old if _stands_for(old, new) else new for old, new in pairs]


def with_quotes(text: str, followed: Sequence[tuple[Command, list[str]]]) -> str:
    """A page that quotes what was printed, where it quotes anything."""
    lines = text.splitlines()
    for command, printed in reversed(followed):
        lines[command.quote.start : command.quote.stop] = command.corrected(printed)
    return "".join(f"{line}\n" for line in lines)


def follow_whole(page: Path) -> str | None:
    """The page as it would be with what its commands print; None where it has no commands.

    Raises:
        WrongDocsError: as of `follow`.
    """
    text, followed, at = page.read_text(encoding="utf-8"), [], _cpu_time()
    if "```console" not in text:
        return None
    with copy_of_the_clone() as folder:
        for command, printed in follow(text, folder):
            took, at = _cpu_time() - at, _cpu_time()
            sys.stderr.write(f"{page.name}: {took:4.0f} s  $ {command.text}\n")
            followed.append((command, printed))
    return with_quotes(text, followed)


def _likely_time(page: Path) -> int:
    """A diagnosis takes about as long as five other commands."""
    text = page.read_text("utf-8")
    return text.count("\n$ ") + 5 * text.count("stagectl gap diagnose ")


def _cpu_time() -> float:
    """Of all processes that this one has started and that have ended [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def main() -> int:
    """Check pages, or write what is printed into them; exit code 1 where they differ."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("what", choices=["check", "quotes"])
    parser.add_argument("pages", nargs="*", type=Path, default=PAGES)
    given = parser.parse_args()
    wrong = False
    longest_first = sorted(given.pages, key=_likely_time, reverse=True)
    with ProcessPoolExecutor() as readers:
        pages = [(page, readers.submit(follow_whole, page)) for page in longest_first]
    for page, outcome in pages:
        try:
            new = outcome.result()
        except WrongDocsError as why:
            sys.stderr.write(f"{page}: {why}\n")
            wrong = True
            continue
        text = page.read_text(encoding="utf-8")
        if new is None or new == text:
            continue
        if given.what == "quotes":
            page.write_text(new, encoding="utf-8")
        else:
            wrong = True
            sys.stderr.writelines(
                difflib.unified_diff(
                    text.splitlines(True), new.splitlines(True), f"{page}", f"{page}, as printed"
                )
            )
    return int(wrong)


if __name__ == "__main__":
    sys.exit(main())
