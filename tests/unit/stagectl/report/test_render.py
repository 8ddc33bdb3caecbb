"""Templates: input is escaped, our own files are not, and nothing may be missing."""

from importlib import resources

import jinja2
import pytest

from stagectl.report import Fact, Outline, Section
from stagectl.report.render import render_page

OUTLINE = Outline(
    "Calibration <script>", "wafer-xy", (Fact("Map 1", "good"),), "a & b",
    sections={"sites": Section("Sites"), "reached": Section("Reached")},
)  # fmt: skip


def test_input_is_escaped_and_style_sheets_are_embedded_as_they_are():
    page = render_page("calibration.html.j2", OUTLINE, pictures=[])
    assert "&lt;script&gt;" in page
    assert "a &amp; b" in page
    style = page.split("<style>")[2].split("</style>")[0]
    assert "&gt;" not in style
    assert "{" in style


def test_a_missing_value_is_an_error_not_a_blank():
    with pytest.raises(jinja2.UndefinedError, match=r"pictures"):
        render_page("calibration.html.j2", OUTLINE)


def test_a_file_that_there_is_not_is_an_error():
    with pytest.raises(OSError, match=r"none.js"):
        render_page("calibration.html.j2", OUTLINE, script="none.js", pictures=[])


def test_the_dark_theme_is_for_screens_only():
    sheet = resources.files("stagectl.report").joinpath("static", "report.css").read_text("utf-8")
    dark = sheet.split(':root[data-theme="dark"]')
    assert len(dark) > 1
    assert all(before.endswith("@media screen { ") for before in dark[:-1]), "paper is light"


def test_every_fact_is_on_the_page_those_that_are_many_folded():
    facts = tuple(Fact(f"fact {n}", share=0.1 * n) for n in range(9))
    sections = {"sites": Section("Sites", facts, most=4), "reached": Section("Reached")}
    outline = Outline("t", "", (), "", sections=sections)
    page = render_page("calibration.html.j2", outline, pictures=[])
    assert all(f">fact {n}<" in page for n in range(9))
    assert "And 5 more" in page
    assert "<h2>Reached" not in page, "it is empty"
