"""Vector's ASC from a spool of frames: directions, times, parts, and the date of the head."""

import pytest

from stagectl.errors import UnusableInput
from stagectl.store.asc_log import find_log, log_part
from tests.unit.stagectl.store.logs import logged

HEAD = 5


def lines(folder, *frames):
    logged(folder, *frames)
    return (folder / "bus.asc").read_text().splitlines()


def test_the_head_has_the_date_in_english_whatever_the_locale(tmp_path):
    head = lines(tmp_path)[:HEAD]
    assert head[0] == "date Mon Nov 02 08:05:06.007 2026"
    assert head[1:3] == ["base hex  timestamps absolute", "internal events logged"]
    assert head[3] == "Begin Triggerblock Mon Nov 02 08:05:06.007 2026"


@pytest.mark.parametrize(
    ("can_id", "way"),
    [
        *((i, "Tx") for i in (0x000, 0x080, 0x201, 0x37F, 0x401, 0x502, 0x601, 0x77F)),
        *((i, "Rx") for i in (0x081, 0x181, 0x282, 0x381, 0x481, 0x581, 0x701)),
    ],
)
def test_what_a_host_sends_is_tx(tmp_path, can_id, way):
    (line,) = lines(tmp_path, (0, can_id, b""))[HEAD:-2]
    assert line.split()[2:4] == [f"{can_id:X}", way]


def test_times_count_from_the_first_frame_and_never_run_back(tmp_path):
    frames = [(5_000_000, 0x80, b""), (4_999_000, 0x80, b""), (6_500_000, 0x181, b"\x01\xfe")]
    first, second, third = lines(tmp_path, *frames)[HEAD:-2]
    assert [line.split()[0] for line in (first, second)] == ["0.000000"] * 2
    assert third.split() == ["0.001500", "1", "181", "Rx", "d", "2", "01", "FE"]


def test_parts_are_numbered_from_1_and_a_gap_among_them_is_named(tmp_path):
    path = tmp_path / "bus.asc"
    assert log_part(path, 12).name == "bus-012.asc.gz"
    assert find_log(path) == []
    for number in (1, 2, 1000):
        log_part(path, number).write_bytes(b"")
    with pytest.raises(UnusableInput, match=r"bus-003\.asc\.gz: no such file, and the log has lat"):
        find_log(path)
    log_part(path, 1000).rename(log_part(path, 3))
    (tmp_path / "bus-notes.asc.gz").write_bytes(b"")
    assert [part.name for part in find_log(path)] == [f"bus-00{n}.asc.gz" for n in (1, 2, 3)]
    path.write_bytes(b"")
    assert find_log(path) == [path]
