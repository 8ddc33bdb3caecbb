"""Jinja templates and static files of the pages."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup

from stagectl.report.outline import Outline

_HERE = Path(__file__).parent
_STATIC = ("uPlot.min.css", "uPlot.iife.min.js", "report.css", "charts.js")


def render_page(
    name: str, outline: Outline, *, script: str = "", data: object = None, **values: Any
) -> str:
    """An HTML page: one file that opens offline.

    Args:
        name: of the template.
        outline: what the page says.
        script: name of the page's own script, which reads `data`; "" for none.
        data: plain values; None for none.
        values: what else the template takes; a missing one is an error.
    """
    # Our own files, not input: they go into <style> and <script> unescaped.
    static = {
        file: Markup((_HERE / "static" / file).read_text(encoding="utf-8"))  # noqa: S704
        for file in (*_STATIC, script)
        if file
    }
    return render_template(
        name, static=static, outline=outline, script=script, data=script_json(data), **values
    )


def render_template(name: str, **values: Any) -> str:
    """A template with its values, Markdown as it is; a missing value is an error."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(_HERE / "templates"),
        autoescape=jinja2.select_autoescape(("html.j2",)),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(name).render(**values)


def script_json(data: object) -> Markup:
    """JSON that cannot end the script element around it."""
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)
    for character in "<>&\u2028\u2029":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return Markup(text)  # noqa: S704 (no character is left that HTML would interpret)
