"""The ledger knows what has been done, and that it may be wrong about what has changed."""

from dataclasses import replace

import pytest

from stagectl.errors import UnusableInput
from stagectl.fleet.ledger import FILE, Ledger
from stagectl.fleet.rows import RESULT, to_parquet
from stagectl.fleet.task import Done


@pytest.fixture
def finish(folder, row):
    """Makes the result of a job, as a worker does."""

    def make(job, content="c", refusal=None):
        name = job.result(content)
        folder.write(name, to_parquet([row(recording="elsewhere")], RESULT))
        return Done(job.url, job.stamp, content, name, False, refusal)

    return make


@pytest.fixture
def known(folder, job, finish):
    """A ledger, saved, that knows 1.h5."""
    ledger = Ledger(folder)
    ledger.note(finish(job("1.h5")))
    ledger.save()
    return folder


def test_what_has_been_done_is_not_to_do(known, job):
    todo, done = Ledger(known).split([job("1.h5"), job("2.h5")])
    assert [of.url for of in todo] == ["2.h5"]
    assert [(of.url, of.reused) for of in done] == [("1.h5", True)]


@pytest.mark.parametrize(
    "change",
    [{"stamp": "2"}, {"stamp": ""}, {"correct": True}, {"version": "9"}, {"machine": ("a", "b")}],
)
def test_what_has_changed_since_is_to_do(known, job, change):
    todo, done = Ledger(known).split([replace(job("1.h5"), **change)])
    assert (len(todo), done) == (1, [])


def test_a_result_that_was_removed_is_to_do(folder, job, finish):
    ledger = Ledger(folder)
    done = finish(job("1.h5"))
    ledger.note(replace(done, result=done.result, content="other"))
    assert len(ledger.split([job("1.h5")])[0]) == 1


def test_rows_are_of_the_recordings_that_have_them(folder, job, finish):
    ledger = Ledger(folder)
    ledger.note(finish(job("1.h5")))
    ledger.note(finish(job("copy-of-1.h5")))
    ledger.note_failure("2.h5", "failed")
    ledger.save()
    again = Ledger(folder)
    rows = list(again.rows())
    assert [row["recording"] for row in rows] == ["1.h5", "copy-of-1.h5"]
    assert "report" not in rows[0]
    assert again.failures() == {"2.h5": "failed"}
    again.note(finish(job("2.h5"), "d"))
    assert again.failures() == {}


def test_a_refusal_is_known_without_reading_the_result(folder, job, finish):
    ledger = Ledger(folder)
    ledger.note(finish(job("1.h5"), refusal="damaged"))
    ledger.save()
    assert Ledger(folder).split([job("1.h5")])[1][0].refusal == "damaged"


def test_damaged_and_missing_files_are_named(known, job):
    name = job("1.h5").result("c")
    known.write(name, b"PAR1 and no more")
    with pytest.raises(UnusableInput, match=f"{name}: damaged"):
        list(Ledger(known).rows())
    known.write(FILE, b"")
    with pytest.raises(UnusableInput, match=f"{FILE}: damaged"):
        Ledger(known)


def test_results_whose_answer_has_not_come_are_adopted(folder, job, row):
    """A client that is stopped knows no more than it was answered."""
    mine, other = job("1.h5"), job("2.h5")
    for of, content in ((mine, "c"), (other, "d")):
        result = to_parquet([row(recording=of.url, content=content)], RESULT)
        folder.write(of.result(content), result)
    folder.write("results/aa/damaged.parquet", b"?")
    ledger = Ledger(folder)
    ledger.adopt([mine])
    ledger.save()
    assert [row["recording"] for row in Ledger(folder).rows()] == [mine.url]
    todo, done = Ledger(folder).split([mine, other])
    assert (todo, [of.url for of in done]) == ([other], [mine.url])
