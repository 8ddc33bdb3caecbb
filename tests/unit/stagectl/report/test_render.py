"""Templates: input is escaped, our own files are not, and nothing may be missing."""

from __future__ import annotations

from importlib import resources
from types import SimpleNamespace

import jinja2
import pytest

from stagectl.report.render import render_template

REPORT = SimpleNamespace(
    name="<script>", stage="wafer-xy", started="", used="none", visited=1, planned=1, error=None,
    version=None, before=None, is_from_recording=False,
)  # fmt: skip
VALUES = {
    "report": REPORT, "level": "good", "verdict": "a & b", "rows": [], "common": [], "reached": [],
    "pictures": [], "watch": "3 %", "act": "10 %",
}  # fmt: skip


def test_input_is_escaped_and_style_sheets_are_embedded_as_they_are() -> None:
    page = render_template("calibration.html.j2", ("report.css",), **VALUES)
    assert "&lt;script&gt;" in page
    assert "a &amp; b" in page
    style = page.split("<style>")[1].split("</style>")[0]
    assert "&gt;" not in style
    assert "{" in style


def test_a_missing_value_is_an_error_not_a_blank() -> None:
    without = {key: value for key, value in VALUES.items() if key != "verdict"}
    with pytest.raises(jinja2.UndefinedError, match=r"verdict"):
        render_template("calibration.html.j2", ("report.css",), **without)


def test_a_file_that_there_is_not_is_an_error() -> None:
    with pytest.raises(OSError, match=r"none.css"):
        render_template("calibration.html.j2", ("none.css",), **VALUES)


@pytest.mark.parametrize("name", ["report.css", "gap.css"])
def test_the_dark_theme_is_for_screens_only(name: str) -> None:
    sheet = resources.files("stagectl.report").joinpath("static", name).read_text("utf-8")
    dark = sheet.split(':root[data-theme="dark"]')
    assert len(dark) > 1
    assert all(before.endswith("@media screen { ") for before in dark[:-1]), "paper is light"
