"""Reports as documents of strangers: in a sandbox, with no scripts but this program's own.

A report carries its scripts inside. Those that this version puts into its pages are allowed by
their hashes; any other, such as one that a file name has smuggled in, does not run.
"""

from __future__ import annotations

import base64
import hashlib
from functools import cache
from pathlib import Path

_STATIC = Path(__file__).parents[1] / "report" / "static"
_INLINE = "page.start(() => {});"
"""The script of pages that have none of their own (templates/page.html.j2)."""


@cache
def report_policy() -> str:
    """The content policy of reports: an origin of their own, no network, known scripts only."""
    scripts = [path.read_bytes() for path in sorted(_STATIC.glob("*.js"))]
    hashes = " ".join(_hash(script) for script in [*scripts, _INLINE.encode()])
    return (
        f"sandbox allow-scripts allow-downloads; default-src 'none'; script-src {hashes}; "
        "style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'; "
        "frame-ancestors 'none'"
    )


def _hash(script: bytes) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(script).digest()).decode()}'"
