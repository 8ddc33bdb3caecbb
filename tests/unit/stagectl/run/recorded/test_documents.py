"""Summary and report made again from a recording."""

import json
from pathlib import Path

import h5py
import pytest

from stagectl.run import document_paths, is_calibration, rewrite_documents


@pytest.fixture
def made(logged):
    """The recording of a run."""
    return logged / "recording.h5"


@pytest.mark.parametrize(
    ("recording", "suffix"),
    [("recording", ""), ("recording-recovered", "-recovered"), ("of-monday", "-of-monday")],
)
def test_documents_are_named_after_their_recording(recording, suffix):
    summary, report = document_paths(Path("run", f"{recording}.h5"))
    assert (str(summary), str(report)) == (f"run/summary{suffix}.json", f"run/report{suffix}.html")


def test_those_of_a_copy_stand_beside_it(made):
    copy = made.with_name("copy.h5")
    copy.write_bytes(made.read_bytes())
    _, written = rewrite_documents(copy)
    assert [path.name for path in written] == ["summary-copy.json", "report-copy.html"]


def test_a_calibration_gets_no_report_of_a_run(made):
    assert not is_calibration(made)
    with h5py.File(made, "r+") as file:
        events = [json.loads(text) for text in file["events"].asstr()]
        events[0]["calibration"] = True
        file["events"][0] = json.dumps(events[0])
    assert is_calibration(made)
    made.with_name("report.html").unlink()
    _, written = rewrite_documents(made)
    assert [path.name for path in written] == ["summary.json"]
    assert not made.with_name("report.html").exists()
