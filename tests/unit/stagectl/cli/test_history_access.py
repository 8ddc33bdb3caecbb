"""Which stage of a history a map command is about."""

from __future__ import annotations

from pathlib import Path

import pytest

from stagectl.cli.history_access import _open_history, has_estimates, has_maps
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


def test_the_only_stage_with_a_map_is_meant(where: str) -> None:
    with _open_history(where, None, None, False, has_maps) as (_, stage):
        assert stage == VIRTUAL


def test_a_map_is_built_for_the_only_stage_with_estimates(where: str) -> None:
    with _open_history(where, None, None, False, has_estimates) as (_, stage):
        assert stage == REAL


def test_options_come_first(where: str) -> None:
    with _open_history(where, None, False, False, has_maps) as (_, stage):
        assert stage == REAL


def test_two_stages_with_maps_have_to_be_told_apart(where: str) -> None:
    history = open_history(where, write=True)
    history.save_map(REAL, 0.0, "", "{}")
    history.close()
    with (
        pytest.raises(UnusableInput, match=r"wafer-xy \(simulated\): which one\?"),
        _open_history(where, None, None, False, has_maps),
    ):
        pass
