"""What a run is made of: figures to start from, and earlier runs that the history lacks."""

import pytest

from stagectl.history import StageKey, open_history
from stagectl.run import HostSettings, Listener, Resumed, execute
from stagectl.run.prepare import file_earlier_runs, prepare
from tests.unit.stagectl.run.whole import request_for


@pytest.fixture
def request_of(machine, tmp_path):
    def make(folder="run", friction_scale=1.0, **given):
        host = HostSettings(friction_scale=friction_scale)
        return request_for(machine, tmp_path / folder, host=host, **given)

    return make


def coulomb(request):
    told = []
    _, compensation = prepare(request, told.append)
    assert told == ["preparing the estimator"], "it takes long"
    return [axis.estimator.friction.coulomb for axis in compensation]


def test_a_run_starts_from_the_machine_file_scaled(request_of, machine):
    stated = [axis.plant.friction.coulomb for axis in machine.axes.values()]
    assert coulomb(request_of()) == pytest.approx(stated)
    assert coulomb(request_of(friction_scale=0.5)) == pytest.approx([0.5 * c for c in stated])


def test_a_resumed_run_starts_from_what_was_accepted_last(request_of, machine):
    resumed = Resumed("/a", "t", 1, {"y": {"coulomb": (7.5, 0.1)}})
    x, y = coulomb(request_of(resumed=resumed, friction_scale=0.5))
    assert y == pytest.approx(7.5)
    assert x == pytest.approx(0.5 * machine.axes["x"].plant.friction.coulomb)


def test_without_a_history_nothing_is_filed_and_none_is_made(request_of, tmp_path):
    told = []
    file_earlier_runs(request_of(), told.append)
    file_earlier_runs(request_of(history=str(tmp_path / "stage.db")), told.append)
    assert told == []
    assert not (tmp_path / "stage.db").exists()


def test_a_run_that_the_history_has_is_not_filed_again(request_of, tmp_path):
    where = tmp_path / "stage.db"
    execute(request_of("first", history=str(where)), Listener())
    told = []
    file_earlier_runs(request_of("second", history=str(where)), told.append)
    history = open_history(str(where))
    assert (len(history.runs(StageKey("wafer-xy", True))), told) == (1, [])
    history.close()
