"""Which stage of a history a map command is about."""

from __future__ import annotations

from pathlib import Path

import pytest

from stagectl.cli.history_access import HistoryOptions, has_estimates, has_maps
from stagectl.errors import UnusableInput
from stagectl.history import EstimateRecord, RunEntry, StageKey, open_history

REAL, VIRTUAL = StageKey("wafer-xy", False), StageKey("wafer-xy", True)


@pytest.fixture
def where(tmp_path: Path) -> str:
    """A history of two stages: the virtual one has a map, the real one an estimate."""
    path = str(tmp_path / "stage.db")
    history = open_history(path, write=True)
    for stage in (REAL, VIRTUAL):
        run = history.start_run(RunEntry(stage, ("x",), 0.0, "r", None, None, "s", "f"))
        if stage is REAL:
            figures, covariance = {"coulomb": 6.0}, (0.01,)
            history.add([
                EstimateRecord(
                    run, "x", "macro", 1, (0.0, 0.0), 1.0, 0.1, True, None, figures, covariance
                )
            ])  # fmt: skip
    history.save_map(VIRTUAL, 0.0, "", "{}")
    history.close()
    return path


@pytest.mark.parametrize(
    ("simulated", "has", "meant"),
    [(None, has_maps, VIRTUAL), (None, has_estimates, REAL), (False, has_maps, REAL)],
    ids=["the only one with a map", "the only one with estimates", "options come first"],
)
def test_stage_that_is_meant(where: str, simulated, has, meant) -> None:
    with HistoryOptions(where, simulated=simulated).open(has=has) as (_, stage):
        assert stage == meant


def test_two_stages_with_maps_have_to_be_told_apart(where: str) -> None:
    history = open_history(where, write=True)
    history.save_map(REAL, 0.0, "", "{}")
    history.close()
    with (
        pytest.raises(UnusableInput, match=r"wafer-xy \(simulated\): which one\?"),
        HistoryOptions(where).open(),
    ):
        pass
