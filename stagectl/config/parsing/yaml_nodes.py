"""Strict YAML: every value with its place in the file, no surprising conversions, bounded size.

libyaml (`yaml.CSafeLoader`) parses the file into events; the values are made here by the YAML 1.2
core rules. PyYAML's own rules (YAML 1.1) would read `1e-8` as a string, `on` as true and `010` as
8, and let the last of two equal keys win. Numbers are decimal and finite; keys are strings and
unique; anchors, aliases, tags and further documents are refused. Size, depth and number of values
are limited before anything is built, so no file can exhaust the host. Texts with control characters
are refused: names end up in folders, on terminals and in databases.

Octal and hexadecimal numbers, dates, binary data and merge keys are not supported: they remain
strings and are refused where a number is expected.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, NoReturn

import yaml
from yaml import events

from stagectl.config.parsing.comments import without_passwords
from stagectl.errors import ConfigError
from stagectl.plain_text import find_control, one_line

MAX_BYTES: Final = 4 * 1024 * 1024
MAX_DEPTH: Final = 32
MAX_VALUES: Final = 200_000
_TOO_DEEP: Final = f"nested deeper than {MAX_DEPTH} levels"

_TYPE_NAMES: Final[dict[type, str]] = {dict: "a mapping", list: "a list", type(None): "empty"}

# libyaml if PyYAML was built with it, as its wheels are; else the same events, more slowly
_LOADER: Final = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_INT = re.compile(r"[-+]?[0-9]+\Z")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?\Z")
_LEADING_ZERO = re.compile(r"[-+]?0[0-9]+\Z")
_NOT_FINITE = re.compile(r"([-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN))\Z")
_WORDS: Final[dict[str, bool | None]] = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL")),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
}

Location = Sequence[str | int]


@dataclass(frozen=True, slots=True)
class Mark:
    """A place in a file; line and column from 1."""

    line: int
    column: int

    @classmethod
    def after(cls, text: str) -> Mark:
        """The place where a text ends."""
        return cls(text.count("\n") + 1, len(text) - text.rfind("\n"))

    def __str__(self) -> str:
        return f"{self.line}:{self.column}"


@dataclass(frozen=True, slots=True)
class Node:
    """A value and its place; `keys` has the place of each key of a mapping."""

    value: object
    mark: Mark
    children: dict[str | int, Node] = field(default_factory=dict)
    keys: dict[str, Mark] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Document:
    """A parsed file: plain Python values in `data`, and their places.

    Attributes:
        name: of the file, in messages.
        text: of the file, without passwords in comments: it is passed on.
        root: the tree of values with their marks.
        problems: values that were refused, one line each. `data` holds placeholders for them, so
            that the rest can be validated too; `validation.validate` reports both.
    """

    name: str
    text: str
    root: Node
    problems: tuple[str, ...] = ()

    @property
    def data(self) -> object:
        """The values: dicts, lists, str, int, float, bool, None."""
        return self.root.value

    def with_text(self, key: str, value: str) -> Document:
        """The document with another text as the value of a top-level key; the rest as written."""
        mapping: Any = yaml.compose(self.text, Loader=_LOADER)
        old = next(node for name, node in mapping.value if name.value == key)
        begin, end = old.start_mark.index, old.end_mark.index
        line_end = "\n" if self.text[begin:end].endswith("\n") else ""  # of a block scalar
        new = json.dumps(value, ensure_ascii=False) + line_end
        return parse_document(self.text[:begin] + new + self.text[end:], self.name)

    def problem(self, location: Location, reason: str, *, at_key: bool = False) -> str:
        """One line `file:line:column: key: reason`.

        Args:
            location: keys and list indices (from 0) from the top of the file. If the file does not
                have it (a missing key, a validator's tag), the place is that of the nearest
                mapping or list around it. The message counts list items from 1, like sites.
            reason: what is wrong there.
            at_key: whether the place is that of the key rather than of its value.
        """
        node, mark, path = self.root, self.root.mark, ""
        for position, part in enumerate(location):
            child = node.children.get(part)
            if child is not None:
                mark = node.keys.get(str(part), child.mark) if at_key else child.mark
                node = child
            elif position < len(location) - 1 or isinstance(part, int):
                continue  # a validator's tag
            path += f"[{part + 1}]" if isinstance(part, int) else f".{part}"
        return format_problem(self.name, mark, path.removeprefix("."), reason)


def format_problem(name: str, mark: Mark | None, key: str, reason: str) -> str:
    """`file:line:column: key: reason`, without the parts that are unknown."""
    place = f"{one_line(name, 300)}:{mark}" if mark else one_line(name, 300)
    return ": ".join(part for part in (place, one_line(key), one_line(reason, 400)) if part)


def _refusal(name: str, reason: str, mark: Mark | None = None) -> ConfigError:
    """Of a whole file."""
    return ConfigError(format_problem(name, mark, "", reason))


def describe_value(value: object) -> str:
    """A value as messages show it: `a list`, `'abc'`, `12`."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return f"{value:.12g}"
    for kind, name in _TYPE_NAMES.items():
        if isinstance(value, kind):
            return name
    return one_line(repr(value), 60)


def read_text(path: Path) -> str:
    """The text of a UTF-8 file.

    Raises:
        ConfigError: there is no such file, or it is too large or not UTF-8 text.
    """
    name = str(path)
    try:
        with path.open("rb") as file:
            raw = file.read(MAX_BYTES + 1)
    except FileNotFoundError:
        raise _refusal(name, "no such file") from None
    except IsADirectoryError:
        raise _refusal(name, "is a directory, not a file") from None
    except (OSError, ValueError) as error:
        reason = f"cannot be read: {getattr(error, 'strerror', None) or error}"
        raise _refusal(name, reason) from None
    if len(raw) > MAX_BYTES:
        raise _refusal(name, f"is larger than {MAX_BYTES // 1024 // 1024} MiB")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        mark = Mark.after(raw[: error.start].decode("latin-1"))
        reason = f"is not UTF-8 text (byte 0x{raw[error.start]:02x})"
        raise _refusal(name, reason, mark) from None


def load_document(path: Path | str) -> Document:
    """Read and parse a file.

    Raises:
        ConfigError: the file cannot be read, or is not YAML as defined here.
    """
    return parse_document(read_text(Path(path)), str(path))


def parse_document(text: str, name: str) -> Document:
    """Parse a text, which messages call `name`.

    Raises:
        ConfigError: it is not YAML as defined here. Refused values do not raise; they are in
            `problems`.
    """
    problems: list[str] = []
    if len(text) > MAX_BYTES:
        raise _refusal(name, "is too large")
    try:
        root = _Builder(name, problems).build(yaml.parse(text, Loader=_LOADER))
    except yaml.MarkedYAMLError as error:
        place = error.problem_mark or error.context_mark
        mark = Mark(place.line + 1, place.column + 1) if place else None
        context = f" ({error.context})" if error.context else ""
        reason = f"not valid YAML: {error.problem}{context}"
        if "nesting depth" in str(error.problem):  # PyYAML's limit, from 6.0.4 on, is above ours
            reason = _TOO_DEEP
        raise _refusal(name, reason, mark) from None
    except yaml.reader.ReaderError as error:
        mark = Mark.after(text[: error.position])
        reason = "not a text file: it holds control characters"
        raise _refusal(name, reason, mark) from None
    except (yaml.YAMLError, UnicodeError) as error:
        raise _refusal(name, f"not valid YAML: {error}") from None
    if root is None or root.value is None:
        raise _refusal(name, "is empty", Mark(1, 1))
    return Document(name, without_passwords(text), root, tuple(problems))


class _Builder:
    """Turns the parser's events into nodes, limited in depth and number."""

    def __init__(self, name: str, problems: list[str]) -> None:
        self._name = name
        self._problems = problems
        self._values = 0

    def build(self, stream: Iterator[events.Event]) -> Node | None:
        """The root node; None for a stream without a document."""
        root: Node | None = None
        for event in stream:
            if isinstance(event, events.DocumentStartEvent):
                if root is not None:
                    self._refuse(event, "", "a second document: a file may hold only one")
                root = self._node(next(stream), stream, "", 0)
        return root

    def _node(self, event: events.Event, stream: Iterator[events.Event], key: str, d: int) -> Node:
        self._values += 1
        if d > MAX_DEPTH:
            self._refuse(event, key[:40], _TOO_DEEP)
        if self._values > MAX_VALUES:
            self._refuse(event, key, f"more than {MAX_VALUES} values")
        if isinstance(event, events.AliasEvent) or getattr(event, "anchor", None):
            self._refuse(event, key, "anchors (&) and aliases (*) are not supported: write it out")
        if getattr(event, "tag", None):
            self._refuse(event, key, "tags (!) are not supported")
        if isinstance(event, events.SequenceStartEvent):
            return self._sequence(event, stream, key, d)
        if isinstance(event, events.MappingStartEvent):
            return self._mapping(event, stream, key, d)
        assert isinstance(event, events.ScalarEvent)  # noqa: S101 - nothing else can start a node
        return Node(self._scalar(event, key), _mark(event))

    def _sequence(
        self, start: events.Event, stream: Iterator[events.Event], key: str, d: int
    ) -> Node:
        items: list[Node] = []
        while not isinstance(event := next(stream), events.SequenceEndEvent):
            items.append(self._node(event, stream, f"{key}[{len(items) + 1}]", d + 1))
        children: dict[str | int, Node] = dict(enumerate(items))
        return Node([item.value for item in items], _mark(start), children)

    def _mapping(
        self, start: events.Event, stream: Iterator[events.Event], key: str, d: int
    ) -> Node:
        children: dict[str | int, Node] = {}
        keys: dict[str, Mark] = {}
        while not isinstance(event := next(stream), events.MappingEndEvent):
            if not isinstance(event, events.ScalarEvent):
                self._refuse(event, key, "a key must be a text")
            path = f"{key}.{event.value}" if key else str(event.value)
            label = self._node(event, stream, path, d + 1).value
            if not isinstance(label, str):
                self._problem(event, path, f"a key must be a text, is {describe_value(label)}")
                label = str(event.value)
            child = self._node(next(stream), stream, path, d + 1)
            if label in keys:
                first = keys[label]
                self._problem(event, path, f"duplicate key (first at line {first.line})")
            else:
                keys[label] = _mark(event)
                children[label] = child
        return Node({k: n.value for k, n in children.items()}, _mark(start), children, keys)

    def _scalar(self, event: events.ScalarEvent, key: str) -> object:
        text = str(event.value)
        if (reason := find_control(text)) is not None:
            self._problem(event, key, reason)
            return one_line(text)
        if event.implicit and not event.implicit[0]:  # quoted or block: always a string
            return text
        if text in _WORDS:
            return _WORDS[text]
        if _NOT_FINITE.match(text):
            self._problem(event, key, f"must be a finite number, is {text}")
            return 0.0
        if _LEADING_ZERO.match(text):
            plain = text.lstrip("+-").lstrip("0") or "0"
            reason = f"number with a leading zero: write {plain}, or '{one_line(text, 40)}' quoted"
            self._problem(event, key, reason)
            return 0
        if _INT.match(text) and len(text) <= 18:
            return int(text)
        if _FLOAT.match(text):
            value = float(text)
            if not math.isfinite(value):
                self._problem(event, key, "must be a finite number, is too large")
                return 0.0
            return value
        return text

    def _problem(self, event: events.Event, key: str, reason: str) -> None:
        self._problems.append(format_problem(self._name, _mark(event), key, reason))

    def _refuse(self, event: events.Event, key: str, reason: str) -> NoReturn:
        """Stop parsing: the rest of the file cannot be read within the limits."""
        self._problem(event, key, reason)
        raise ConfigError(self._problems)


def _mark(event: events.Event) -> Mark:
    start = event.start_mark
    return Mark(start.line + 1, start.column + 1) if start else Mark(1, 1)
