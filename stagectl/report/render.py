"""Jinja templates and static files of the pages."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup

_HERE = Path(__file__).parent


def render_template(name: str, static: tuple[str, ...], **values: Any) -> str:
    """A page: HTML, or Markdown as it is.

    Args:
        name: of the template.
        static: names of style sheets and scripts to embed; the template finds them in `static`.
        values: for the template; a missing one is an error.
    """
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(_HERE / "templates"),
        autoescape=jinja2.select_autoescape(("html.j2",)),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    # Our own files, not input: they go into <style> and <script> unescaped.
    inline = {n: Markup((_HERE / "static" / n).read_text(encoding="utf-8")) for n in static}  # noqa: S704
    return environment.get_template(name).render(static=inline, **values)


def script_json(data: object) -> Markup:
    """JSON that cannot end the script element around it."""
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)
    for character in "<>&\u2028\u2029":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return Markup(text)  # noqa: S704 (no character is left that HTML would interpret)
