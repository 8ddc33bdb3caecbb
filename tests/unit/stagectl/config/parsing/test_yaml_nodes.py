"""Values by the YAML 1.2 core rules; everything ambiguous or unbounded refused with its place."""

import math
import random
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from stagectl.config.parsing.yaml_nodes import load_document, parse_document
from stagectl.errors import ConfigError

NASTY = "{}[]:,&*!|>'\"%@`#-? \t\n0\x00\u00e9"


def value(text):
    document = parse_document(f"a: {text}", "f.yaml")
    assert document.problems == ()
    return document.data["a"]


def problems(text):
    try:
        return parse_document(text, "f.yaml").problems
    except ConfigError as error:
        return error.problems


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("1e-8", 1e-8),
        ("1E3", 1000.0),
        (".5", 0.5),
        ("5.", 5.0),
        ("-0.0", 0.0),
        ("12", 12),
        ("on", "on"),
        ("yes", "yes"),
        ("NO", "NO"),
        ("true", True),
        ("~", None),
        ("", None),
        ("0x10", "0x10"),
        ("0o10", "0o10"),
        ("1_000", "1_000"),
        ("1:30", "1:30"),
        ("2026-11-21", "2026-11-21"),
        ("'1e-8'", "1e-8"),
        ('"true"', "true"),
        ("nan", "nan"),
        ("<<", "<<"),
        ('"\u00b5-\u30b9\u30c6\u30fc\u30b8"', "\u00b5-\u30b9\u30c6\u30fc\u30b8"),
        ('"10\u00a0nm"', "10\u00a0nm"),
    ],
)
def test_scalars_follow_yaml_1_2(text, expected):
    got = value(text)
    assert got == expected
    assert type(got) is type(expected)


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_every_finite_float_survives_its_own_text(number):
    got = value(repr(number))
    assert isinstance(got, float)
    assert math.copysign(1, got) == math.copysign(1, number)
    assert got == number


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("a: 1\nb: 2\na: 3\n", "f.yaml:3:1: a: duplicate key (first at line 1)"),
        ("a: {b: 1, b: 1}", "f.yaml:1:11: a.b: duplicate key (first at line 1)"),
        ("a: .nan", "f.yaml:1:4: a: must be a finite number, is .nan"),
        ("a: [1, -.inf]", "f.yaml:1:8: a[2]: must be a finite number, is -.inf"),
        ("a: 1e999", "f.yaml:1:4: a: must be a finite number, is too large"),
        ("a: 010", "f.yaml:1:4: a: number with a leading zero: write 10, or '010' quoted"),
        ("1: a", "f.yaml:1:1: 1: a key must be a text, is 1"),
        ("? [a]\n: b", "f.yaml:1:3: a key must be a text"),
        ("a: !!float 1", "f.yaml:1:4: a: tags (!) are not supported"),
        ("a: !!python/object/apply:os.system [x]", "f.yaml:1:4: a: tags (!) are not supported"),
        ("a: 1\n---\na: 2", "f.yaml:2:1: a second document: a file may hold only one"),
        ("", "f.yaml:1:1: is empty"),
        ("# nothing\n", "f.yaml:1:1: is empty"),
        ("a: \x01", "f.yaml:1:4: not a text file: it holds control characters"),
        ('a: "stage\\0"', "f.yaml:1:4: a: holds the control character U+0000"),
        ('a: "\\e[31mred"', "f.yaml:1:4: a: holds the control character U+001B"),
        ('a: "\\u202Eesrever"', "f.yaml:1:4: a: holds the control character U+202E"),
        ("a: |\n  two\n  lines", "f.yaml:1:4: a: holds the control character U+000A"),
    ],
)
def test_what_is_refused_and_where(text, line):
    assert problems(text) == (line,)


def test_all_refused_values_are_reported_at_once():
    assert len(problems("a: .nan\nb: 07\nc: {d: 1, d: 2}")) == 3


@pytest.mark.parametrize("text", ["a: [1", "a: 'x", "a:\t- b", "a: b: c", "- a\nb: 1", "a: @x"])
def test_broken_syntax_is_one_line_with_a_place(text):
    (line,) = problems(text)
    assert line.startswith("f.yaml:")
    assert "not valid YAML" in line
    assert "\n" not in line


def test_an_alias_bomb_is_refused_at_its_first_anchor():
    bomb = "a: &a [x,x,x,x,x,x,x,x,x]\n" + "".join(
        f"{chr(98 + i)}: &{chr(98 + i)} [{','.join(['*' + chr(97 + i)] * 9)}]\n" for i in range(9)
    )
    (line,) = problems(bomb)
    assert line.startswith("f.yaml:1:4: a: anchors (&) and aliases (*)")


@pytest.mark.parametrize(
    "text", ["[" * 100_000, "a: " + "{b: " * 50_000, "- " * 20_000 + "x", "? " * 20_000]
)
def test_deep_nesting_is_refused_without_following_it(text):
    (line,) = problems(text)
    assert "nested deeper than 32 levels" in line or "a key must be a text" in line
    assert len(line) < 300


def test_the_number_of_values_is_bounded():
    (line,) = problems("a:\n" + "-\n" * 200_001)
    assert "more than 200000 values" in line


def test_files_that_cannot_be_read(tmp_path):
    binary = tmp_path / "binary.yaml"
    binary.write_bytes(b"a: 1\nb: \xff\xfe\x00")
    large = tmp_path / "large.yaml"
    large.write_bytes(b"#" * (4 * 1024 * 1024 + 1))
    for path, line in {
        tmp_path / "none.yaml": f"{tmp_path}/none.yaml: no such file",
        tmp_path: f"{tmp_path}: is a directory, not a file",
        binary: f"{binary}:2:4: is not UTF-8 text (byte 0xff)",
        large: f"{large}: is larger than 4 MiB",
    }.items():
        with pytest.raises(ConfigError) as caught:
            load_document(path)
        assert caught.value.problems == (line,)
    with pytest.raises(ConfigError, match="cannot be read"):
        load_document(Path("a\0b"))


def test_a_byte_order_mark_and_crlf_are_no_problem(tmp_path):
    path = tmp_path / "dos.yaml"
    path.write_bytes(b"\xef\xbb\xbfa: 1\r\nb: 2\r\n")
    assert load_document(path).data == {"a": 1, "b": 2}


def test_problems_are_placed_at_values_keys_and_nearest_parents():
    document = parse_document("a:\n  b: [1, {c: 2}]\n", "f.yaml")
    assert document.problem(("a", "b", 1, "c"), "x") == "f.yaml:2:14: a.b[2].c: x"
    assert document.problem(("a", "b", 1, "c"), "x", at_key=True) == "f.yaml:2:11: a.b[2].c: x"
    assert document.problem(("a", "missing"), "x") == "f.yaml:2:3: a.missing: x"
    assert document.problem(("a", "tag", "b", 0), "x") == "f.yaml:2:7: a.b[1]: x"


def test_random_bytes_are_a_document_or_a_problem():
    """Bytes flipped, cut and doubled in a real file: a document or a ConfigError, one line each."""
    source = "recipe: a\nmacro: {velocity: 0.5, jerk: 2e2}\nsites: [[0, 1], [2, 3]]\nx: 'q'\n"
    random_ = random.Random(3)  # noqa: S311 - not for secrets
    refused = 0
    for _ in range(400):
        text = list(source)
        for _ in range(random_.randint(1, 4)):
            at = random_.randrange(len(text))
            text[at : at + random_.randint(0, 3)] = random_.choice(NASTY)
        try:
            document = parse_document("".join(text), "f.yaml")
            lines = document.problems
        except ConfigError as error:
            lines = error.problems
        refused += bool(lines)
        assert all(line.startswith("f.yaml") and "\n" not in line for line in lines)
    assert refused > 50


def test_a_key_with_a_control_character_is_refused():
    (problem,) = problems('"a\\e": 1')
    assert problem.endswith("holds the control character U+001B")
    assert problem.isprintable()
