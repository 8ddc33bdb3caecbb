"""The JSON schemas of what commands write, as docs/formats has them: `python tools/schemas.py`."""

from __future__ import annotations

import json
from pathlib import Path

from sim2real.findings import schema

FOLDER = Path(__file__).parents[1] / "docs" / "formats"
SCHEMAS = {"gap-report.schema.json": schema}


def main() -> None:
    """Write them."""
    for name, made in SCHEMAS.items():
        (FOLDER / name).write_text(json.dumps(made(), indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
