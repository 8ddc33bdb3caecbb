"""What a run makes, and what it leaves alone where it cannot begin."""

from datetime import UTC, datetime

import pytest

from stagectl.errors import UnusableInput
from stagectl.recipe import parse_recipe
from stagectl.run import HostSettings, Listener, RunRequest, SimulatedStage, execute
from stagectl.sequencer import Mode
from stagectl.store import Journal, JournalHeader, read_recording
from tests.short_recipe import short_recipe
from tests.unit.stagectl.store.journals import HEADER, sample


@pytest.fixture
def request_of(machine, tmp_path):
    def make(**changes):
        recipe = parse_recipe(short_recipe((0.004, 0.0)), "r.yaml", machine)
        given = {
            "recipe": recipe, "machine": machine, "folder": tmp_path / "run",
            "started": datetime.now(UTC), "simulated": SimulatedStage(machine),
            "host": HostSettings(Mode.NONE),
        }  # fmt: skip
        return RunRequest(**{**given, **changes})

    return make


def test_no_folder_is_made_before_the_bus_is_open(request_of, tmp_path):
    request = request_of(simulated=None, bus=("socketcan", "no-such-interface"))
    with pytest.raises(UnusableInput, match="no-such-interface"):
        execute(request, Listener())
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_made_is_named(request_of, tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(UnusableInput, match="file is not a folder"):
        execute(request_of(folder=tmp_path / "file" / "run"), Listener())


def test_the_journal_of_a_killed_run_is_recovered_beside_the_new_recording(request_of, tmp_path):
    folder = tmp_path / "run"
    folder.mkdir()
    with Journal(folder, JournalHeader("m", "r", HEADER.started, HEADER.axes)) as left:
        for k in range(7):
            left.sink(sample(k))
    phases = []
    result = execute(request_of(), Listener(phase=phases.append))
    assert result.error is None
    assert any("its 7 samples are now" in phase for phase in phases)
    assert len(read_recording(folder / "recording-recovered.h5")) == 7
    assert len(read_recording(folder / "recording.h5")) == len(result.recording)


def test_the_files_of_an_earlier_run_are_set_aside(request_of, machine, tmp_path):
    first = execute(request_of(), Listener())
    second = execute(request_of(simulated=SimulatedStage(machine, 2)), Listener())
    kept, new = tmp_path / "run" / "previous", tmp_path / "run"
    assert {p.name for p in kept.iterdir()} == {
        "recording.h5", "summary.json", "report.html", "bus.asc",
    }  # fmt: skip
    assert read_recording(kept / "recording.h5").started == first.recording.started
    assert read_recording(new / "recording.h5").started == second.recording.started


def test_the_history_is_made_with_the_run(request_of, tmp_path):
    where = tmp_path / "stage.db"
    assert execute(request_of(history=str(where)), Listener()).unwritten is None
    assert where.exists()
