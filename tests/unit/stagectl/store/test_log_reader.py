"""bus.asc read back, and its digest."""

import pytest

from stagectl.errors import UnusableInput
from stagectl.store import LoggedFrame, read_log
from stagectl.store.asc_log import BUS_FAILED
from tests.unit.stagectl.store.logs import ONE, logged


def test_a_bus_failure_is_in_the_log(tmp_path):
    back = read_log(logged(tmp_path, ONE, (5000, BUS_FAILED, b"")).path)
    sent, failed = back.frames()
    assert sent == LoggedFrame(0, True, *ONE[1:])
    assert failed == LoggedFrame(5000, False, -1, b"")
    assert (sent.failed, failed.failed) == (False, True)


UNLIKE = (("0.1", "1 00"), ("0.000001", "9 00"), ("0.000001", "2 00\x1f00"))


@pytest.mark.parametrize(
    "line",
    ["rubbish", *(f"{at} 1 201 Tx d {data}" for at, data in UNLIKE), "\x1c"],
)
def test_a_line_of_another_form_is_named(tmp_path, line):
    path = logged(tmp_path, ONE).path
    path.write_text(path.read_text().replace("End", f"{line}\nEnd"))
    with pytest.raises(UnusableInput, match=r"bus\.asc:7: not a frame of a bus log"):
        read_log(path)


def test_a_log_without_digest_can_be_read(tmp_path):
    path = tmp_path / "bus.asc"
    path.write_text("date x\nbase hex  timestamps absolute\n0.000000 1  80  Tx   d 0\n")
    assert read_log(path).stated is None
    assert read_log(path).count == len(list(read_log(path).frames())) == 1


def test_what_follows_the_digest_is_a_change(tmp_path):
    log = logged(tmp_path, ONE)
    path = log.path
    assert read_log(path).stated == log.digest
    path.write_text(path.read_text() + "0.000001 1 201 Tx d 0\n")
    changed = read_log(path)
    assert changed.digest == log.digest
    assert changed.stated not in (None, log.digest)
    assert changed.count == 1


def test_line_ends_of_another_system_do_not_change_the_digest(tmp_path):
    log = logged(tmp_path, ONE)
    log.path.write_bytes(log.path.read_bytes().replace(b"\n", b"\r\n"))
    back = read_log(log.path)
    assert back.digest == back.stated == log.digest


def test_a_log_that_has_changed_since_it_was_checked_is_refused_at_its_end(tmp_path):
    path = logged(tmp_path, *((number * 1000, *ONE[1:]) for number in range(10))).path
    back = read_log(path)
    lines = path.read_text().splitlines(keepends=True)
    for changed in (lines[:-4], [*lines[:-4], *lines[-5:]], [*lines[:8], lines[7], *lines[9:]]):
        path.write_text("".join(changed))
        with pytest.raises(UnusableInput, match=r"bus\.asc: has changed since it was checked"):
            list(back.frames())
    path.write_text("".join(lines))
    assert len(list(back.frames())) == back.count


def test_frames_are_read_as_they_are_taken(tmp_path):
    """The file may be larger than memory: what comes after a frame is not read before it."""
    path = logged(tmp_path, *((number * 1000, *ONE[1:]) for number in range(20_000))).path
    back = read_log(path)
    frames = back.frames()
    assert next(frames).time_ns == 0
    text = path.read_text()
    path.write_text(text[: len(text) // 2] + "rubbish\n")
    with pytest.raises(UnusableInput, match="not a frame of a bus log"):
        list(frames)
    assert back.count == 20_000
