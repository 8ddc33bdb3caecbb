"""Which stage of a history a map command is about."""

import pytest

from stagectl.cli.history_access import HistoryOptions, has_estimates, has_maps
from stagectl.errors import UnusableInput
from stagectl.history import StageKey, open_history
from tests.unit.stagectl.rows import estimate_record, run_entry

REAL, VIRTUAL = StageKey("wafer-xy", False), StageKey("wafer-xy", True)


@pytest.fixture
def where(tmp_path):
    """A history of two stages: the virtual one has a map, the real one an estimate."""
    path = str(tmp_path / "stage.db")
    history = open_history(path, write=True)
    for stage in (REAL, VIRTUAL):
        run = history.start_run(run_entry(stage))
        if stage is REAL:
            history.add([estimate_record(run)])
    history.save_map(VIRTUAL, 0.0, "", "{}")
    history.close()
    return path


@pytest.mark.parametrize(
    ("simulated", "has", "meant"),
    [(None, has_maps, VIRTUAL), (None, has_estimates, REAL), (False, has_maps, REAL)],
    ids=["the only one with a map", "the only one with estimates", "options come first"],
)
def test_stage_that_is_meant(where, simulated, has, meant):
    with HistoryOptions(where, simulated=simulated).open(has=has) as (_, stage):
        assert stage == meant


def test_two_stages_with_maps_have_to_be_told_apart(where):
    history = open_history(where, write=True)
    history.save_map(REAL, 0.0, "", "{}")
    history.close()
    with (
        pytest.raises(UnusableInput, match=r"wafer-xy \(simulated\): which one\?"),
        HistoryOptions(where).open(),
    ):
        pass
