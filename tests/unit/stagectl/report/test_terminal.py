"""Outlines on a terminal."""

from stagectl.report import Fact, Outline, Section, Table, print_outline, print_sections
from tests.unit.stagectl.printed import printed


def lines_of(part, width=100):
    return [" ".join(line.split()) for line in printed(part, width).splitlines()]


def test_what_is_many_is_counted_and_what_is_for_pages_left_out():
    facts = tuple(Fact(f"fact {n}") for n in range(9))
    more = Section("More", facts, on_page=True)
    lines = lines_of(print_sections([Section("Facts", facts, most=4), more, Section("None")]))
    assert lines == ["Facts", "fact 0", "fact 1", "fact 2", "fact 3", "and 5 more"]


def test_labels_take_the_place_of_titles_and_details_stand_below():
    facts = (Fact("x: cogging", details=("remedy",)), Fact("y", "warning", label="warning"))
    lines = lines_of(print_sections([Section("Causes", facts, label="cause")]))
    assert lines == ["cause x: cogging", "remedy", "warning y"]


def test_a_table_has_the_columns_that_fit_a_terminal():
    rows = (("x", "1", "2"), ("y", "3", Fact("4", "bad")))
    section = Section("Moves", table=Table(("axis", "mean", "median"), rows, on_page=("mean",)))
    text = lines_of(print_sections([section]))
    assert text[0] == "Moves"
    assert "axis median" in text
    assert text[-2:] == ["x 2", "y 4"] or text[-3:-1] == ["x 2", "y 4"]


def test_an_outline_ends_with_the_command_to_copy_on_one_line():
    command = "stagectl run " + "a-long-name-" * 12
    outline = Outline("r", "on m", (Fact("Aborted", "warning"),), "Why.", command=command)
    for width in (40, 200):
        lines = lines_of(print_outline(outline), width)
        assert lines[0] == "r on m: Aborted. Why."
        assert lines[-1] == f"to continue: {command}"
