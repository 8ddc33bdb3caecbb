"""What a calibration's recording says of it, and of the calibrations that it continued."""

from dataclasses import replace

import pytest

from stagectl.calibration.documents import read_calibration
from stagectl.config import load_machine
from stagectl.errors import UnusableInput
from stagectl.store import RECORDING_NAME, Journal, recover_journal
from tests.unit.stagectl.store.journals import HEADER, sample

SITES = [[0.0, 0.0], [0.02, 0.0], [0.0, 0.0]]


def friction(site, coulomb):
    return {
        "site": site, "axis": "x", "accepted": True, "reason": None,
        "parameters": {"coulomb": [coulomb, 0.05]},
    }  # fmt: skip


def record(folder, run, *estimates):
    """The recording of a killed run with these notes."""
    folder.mkdir()
    with Journal(folder, replace(HEADER, machine=load_machine().text)) as journal:
        journal.event("run", **run)
        for estimate in estimates:
            journal.event("friction", **estimate)
        journal.sink(sample(0))
    return recover_journal(journal.path).path


def test_sites_and_estimates_are_those_of_its_notes(tmp_path):
    path = record(tmp_path / "a", {"sites": SITES, "resumed": None}, friction(1, 6.0))
    found = read_calibration(path)
    assert found.sites == ((0.0, 0.0), (0.02, 0.0), (0.0, 0.0))
    (entry,) = found.friction
    assert (entry["site"], entry["axis"], entry["accepted"]) == (1, "x", True)
    assert entry["parameters"] == {"coulomb": {"value": 6.0, "sigma": 0.05}}


def test_estimates_of_those_that_it_continued_come_first(tmp_path):
    first, second, third = (tmp_path / name for name in "abc")
    record(first, {"sites": SITES, "resumed": None}, friction(1, 6.0))
    record(second, {"sites": SITES, "resumed": {"run": str(first)}}, friction(2, 6.1))
    path = record(third, {"sites": SITES, "resumed": {"run": str(second)}}, friction(3, 6.2))
    assert [entry["site"] for entry in read_calibration(path).friction] == [1, 2, 3]
    (second / RECORDING_NAME).unlink()  # an earlier one may have been deleted
    assert [entry["site"] for entry in read_calibration(path).friction] == [3]


@pytest.mark.parametrize("run", [{"sites": None, "resumed": None}, {"resumed": None}])
def test_a_production_run_is_no_calibration(tmp_path, run):
    path = record(tmp_path / "a", run)
    with pytest.raises(UnusableInput, match="not a calibration, or one of an older version"):
        read_calibration(path)


def test_damaged_notes_are_one_line(tmp_path):
    path = record(tmp_path / "a", {"sites": [[0.0]], "resumed": None})
    with pytest.raises(UnusableInput, match=r"recording\.h5: /events: damaged \(ValueError"):
        read_calibration(path)
