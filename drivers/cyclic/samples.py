"""Raw process data per SYNC, as the sink gets it, and its conversion to `stagedata.Samples`."""

from __future__ import annotations

from array import array
from collections.abc import Sequence

import numpy as np

from drivers.drive import Scale
from stagedata import Samples

Sample = tuple[int, ...]
"""One SYNC for the sink: (time_ns, late, sync_ns, doubt_ns, then per axis: target_counts,
offset_permille, position_counts, force_permille, statusword, valid, arrival_ns, extra); arrival -1
when there is no sample, doubt -1 when not known. `extra` belongs to the SYNC before: its TPDOs that
came besides until this SYNC, at most 255."""

HEAD, FIELDS, VALID = 4, 8, 5
"""Values in a `Sample` before those of the axes; values per axis; place of `valid` among them."""


def decode_rows(
    rows: array[int], scales: Sequence[Scale], targets: Sequence[float] | None = None
) -> Samples:
    """Samples from the concatenated `Sample` tuples of any number of SYNCs.

    Args:
        rows: the tuples.
        scales: of the axes.
        targets: SI value of one unit of each axis' target; None: targets are positions.
    """
    n = len(scales)
    raw = np.frombuffer(rows, dtype=np.int64).reshape(-1, HEAD + FIELDS * n)
    axes = raw[:, HEAD:].reshape(-1, n, FIELDS)
    increment = np.array([s.increment for s in scales])
    force = np.array([s.force for s in scales])
    valid = axes[:, :, VALID] != 0
    return Samples(
        time=np.asarray(raw[:, 0] * 1e-9, dtype=np.float64),
        position_demand=axes[:, :, 0] * (increment if targets is None else np.array(targets)),
        force_offset=axes[:, :, 1] * force,
        position=axes[:, :, 2] * increment,
        force=axes[:, :, 3] * force,
        statusword=axes[:, :, 4].astype(np.uint16),
        valid=valid,
        arrival=np.where(valid, axes[:, :, 6] * 1e-9, np.nan),
        sync=np.asarray(raw[:, 2] * 1e-9, dtype=np.float64),
        doubt=np.where(raw[:, 3] < 0, np.inf, raw[:, 3] * 1e-9),
        late=raw[:, 1] != 0,
        extra=axes[:, :, 7].astype(np.uint8),
    )
