"""Sphinx: `make docs` builds the site into docs/_build/html."""

import re
from importlib.metadata import version as _version

_OUTSIDE = re.compile(r"\[([^\]]+)\]\((?:(?:\.\./)+[^)]*|[^):#]*/)\)")

project = "stagectl"
copyright = "the stagectl authors"  # noqa: A001  a name of Sphinx's
version = release = _version("stagectl")
extensions = ["myst_parser", "sphinx_click", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
source_suffix = {".md": "markdown"}
exclude_patterns = ["_build", "blind/**", "README.md"]
suppress_warnings = ["misc.highlighting_failure"]  # mermaid stays as text
master_doc = "index"
myst_enable_extensions = ["colon_fence"]
myst_heading_anchors = 4
autodoc_member_order = "bysource"
autodoc_typehints = "description"
html_theme = "alabaster"
html_theme_options = {"fixed_sidebar": True, "page_width": "1200px"}
html_title = "stagectl"


def setup(app):  # type: ignore[no-untyped-def]  # noqa: D103
    app.connect("source-read", lambda app, page, text: _leave_out_links_to_the_clone(text))
    app.connect("include-read", lambda app, path, page, text: _leave_out_links_to_the_clone(text))


def _leave_out_links_to_the_clone(text: list[str]) -> None:
    """Files outside docs/, and folders, are in the clone, not on the site: their names stay."""
    text[0] = _OUTSIDE.sub(r"\1", text[0])
