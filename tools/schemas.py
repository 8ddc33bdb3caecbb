"""The JSON schemas of what commands write, as docs/formats has them: `python tools/schemas.py`."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from sim2real.findings import schema
from stagectl.protocol.requests import Request
from stagectl.protocol.state import Answer, Job, Notice, ServerInfo, State

FOLDER = Path(__file__).parents[1] / "docs" / "formats"
SCHEMAS: dict[str, Callable[[], dict[str, Any]]] = {
    "gap-report.schema.json": schema,
    "server-requests.schema.json": TypeAdapter(Request).json_schema,
    "server-published.schema.json": TypeAdapter(
        Answer | State | Notice | Job | ServerInfo
    ).json_schema,
}


def main() -> None:
    """Write them."""
    for name, made in SCHEMAS.items():
        (FOLDER / name).write_text(json.dumps(made(), indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
