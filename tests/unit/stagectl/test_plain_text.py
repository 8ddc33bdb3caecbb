"""Text on one line: what breaks it is found, or replaced."""

import pytest

from stagectl.plain_text import find_control, one_line


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ("a\nb", "000A"), ("\x1b[31mred", "001B"), ("a\u202eb", "202E"), ("a\u2028b", "2028"),
        ("\ud800", "D800"), ("zero\u200bwidth", "200B"),
    ],
)  # fmt: skip
def test_the_first_control_character_is_named_by_its_code(text, code):
    assert find_control(text) == f"holds the control character U+{code}"


@pytest.mark.parametrize("text", ["", "lot 7", "Größe 3 µm", "日本"])
def test_plain_text_is_plain(text):
    assert find_control(text) is None
    assert one_line(text) == text


def test_one_line_replaces_controls_and_is_cut_at_its_limit():
    assert one_line("a\nb\x1b[0m") == "a\ufffdb\ufffd[0m"
    assert one_line("x" * 80) == "x" * 80
    assert one_line("x" * 81) == "x" * 77 + "..."
    assert one_line(ValueError("no"), 10) == "no"
