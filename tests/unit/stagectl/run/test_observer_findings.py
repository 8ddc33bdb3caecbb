"""What the watchdog has found, in words and in the file that keeps it."""

from datetime import UTC, datetime

import pytest

from estimation.observer import Finding, Kind
from stagectl.config import load_machine
from stagectl.errors import UnusableInput
from stagectl.run.observer_findings import describe, is_out, keep_out, read_out

FED = Finding(0, Kind.FED, 0.2456, 3.1e-7, 38.2, 1.5)


@pytest.fixture
def machine(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text(load_machine().text)
    return load_machine(path)


@pytest.mark.parametrize(
    ("kind", "out", "words"),
    [
        (Kind.FED, True, "the observer fed an oscillation of 38 Hz (310 nm rms)"),
        (Kind.STANDS, True, "a deviation of 310 nm stands that the drive does not see"),
        (Kind.UNANSWERED, True, "the drive does not answer a deviation of 310 nm"),
        (Kind.GROWS, True, "a deviation of 310 nm grows while the correction pushes against it"),
        (Kind.ELSEWHERE, False, "goes on without the observer, which was frozen at 0.246 s"),
        (Kind.SUSPECTED, False, "the run ended before it was clear"),
    ],
)
def test_every_finding_says_what_and_when(kind, out, words):
    finding = FED._replace(kind=kind)
    text = describe("y", finding)
    assert text.startswith("axis y: ")
    assert words in text
    assert "0.246 s" in text
    assert is_out(finding) is out


def test_later_runs_know_what_is_out_until_the_stage_is_measured(machine):
    since = datetime(2026, 11, 25, 12, tzinfo=UTC)
    assert read_out(machine) == {}
    assert "later runs do without the observer of x" in keep_out(machine, {"x": "it fed"}, since)
    later = datetime(2026, 11, 27, tzinfo=UTC)
    keep_out(machine, {"y": "it did not answer"}, later)
    assert read_out(machine) == {
        "x": "out since 2026-11-25T12:00:00+00:00: it fed",
        "y": "out since 2026-11-27T00:00:00+00:00: it did not answer",
    }
    assert list(read_out(machine, "2026-11-26T12:00:00+00:00")) == ["y"]
    assert read_out(machine, "2026-11-28T12:00:00+00:00") == {}


def test_the_packaged_machine_has_no_place_for_it():
    text = keep_out(load_machine(), {"x": "it fed"}, datetime.now(UTC))
    assert "tries the observer again" in text
    assert read_out(load_machine()) == {}


def test_a_damaged_file_is_named(machine, tmp_path):
    (tmp_path / "mine.observer-out.json").write_text('{"format": "other"}')
    with pytest.raises(UnusableInput, match=r"mine\.observer-out\.json: damaged"):
        read_out(machine)
