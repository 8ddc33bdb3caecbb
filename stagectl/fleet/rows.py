"""The result of one recording as a row, and tables of rows as Parquet (docs/formats/fleet.md)."""

from __future__ import annotations

import io
from collections.abc import Iterable, Sequence
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from stagectl.errors import UnusableInput
from stagectl.fleet.storage import Folder

Row = dict[str, Any]
"""Names of a schema -> plain values."""
REFUSED = "refused"
"""In place of a verdict: the recording, or the machine file in it, cannot be used."""

_GAP = pa.struct(
    [("axis", pa.string()), ("signal", pa.string()), ("gap", pa.float64()),
     ("floor", pa.float64()), ("unit", pa.string())]
)  # fmt: skip
_CAUSE = pa.struct(
    [("axis", pa.string()), ("effect", pa.string()), ("probability", pa.float64()),
     ("gap_closed", pa.float64()), ("remedy", pa.string())]
)  # fmt: skip
_FRICTION = pa.struct([("axis", pa.string()), ("coulomb", pa.float64()), ("sigma", pa.float64())])
RESULT = pa.schema(
    [
        ("recording", pa.string()), ("content", pa.string()), ("version", pa.string()),
        ("stage", pa.string()), ("simulated", pa.bool_()),
        ("started", pa.timestamp("us", "UTC")), ("recipe", pa.string()), ("lot", pa.string()),
        ("verdict", pa.string()), ("reason", pa.string()), ("floors", pa.float64()),
        ("gap_closed", pa.float64()), ("channels", pa.list_(pa.string())),
        ("gap", pa.list_(_GAP)), ("causes", pa.list_(_CAUSE)), ("friction", pa.list_(_FRICTION)),
        ("machine", pa.string()), ("report", pa.string()),
    ]
)  # fmt: skip
"""A recording's result."""
WHOLE_ONLY = ("report",)
"""Columns that a summary does not need."""
ENTRY = pa.schema(
    [("recording", pa.string()), ("stamp", pa.string()), ("content", pa.string()),
     ("result", pa.string()), ("refusal", pa.string()), ("failure", pa.string())]
)  # fmt: skip
"""What is known of a recording as listed."""
FRICTION = pa.schema(
    [("stage", pa.string()), ("simulated", pa.bool_()), ("axis", pa.string()),
     ("started", pa.timestamp("us", "UTC")), ("coulomb", pa.float64()),
     ("sigma", pa.float64()), ("source", pa.string())]
)  # fmt: skip
"""Friction of an axis in a run."""


def to_parquet(rows: Sequence[Row], schema: pa.Schema) -> bytes:
    """Rows as a Parquet file; values that a row lacks are null."""
    buffer = io.BytesIO()
    table = pa.Table.from_pylist(list(rows), schema=schema)
    pq.write_table(table, buffer, compression="zstd", write_statistics=len(rows) > 1)
    return buffer.getvalue()


def kept_rows(folder: Folder, name: str, schema: pa.Schema) -> list[Row]:
    """The rows of a table in a folder of results; none where it is not there.

    Raises:
        UnusableInput: it cannot be read.
    """
    content = folder.read([name]).get(name)
    try:
        return [] if content is None else from_parquet(content, schema)
    except ValueError as error:
        raise UnusableInput(f"{folder.address}/{name}: damaged: {error}") from error


def from_parquet(content: bytes, schema: pa.Schema, without: Iterable[str] = ()) -> list[Row]:
    """Rows of a Parquet file.

    Raises:
        ValueError: it is damaged, or lacks a column.
    """
    left_out = set(without)
    columns = [name for name in schema.names if name not in left_out]
    try:
        table = pq.read_table(pa.BufferReader(content), columns=columns)
        rows: list[Row] = table.select(columns).to_pylist()
    except (pa.ArrowException, KeyError, OSError) as error:
        raise ValueError(str(error).split("\n")[0]) from error
    return rows
