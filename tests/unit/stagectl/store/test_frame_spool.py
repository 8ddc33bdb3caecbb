"""Long runs: the spool in parts, compressed while the run goes on, and the log made of them."""

import gzip
import hashlib
import os
import shutil

import can
import pytest

from stagectl.errors import UnusableInput
from stagectl.store import BusLog, read_log, recover_log
from tests.unit.stagectl.store.logs import STARTED, logged
from tests.waiting import wait_until

PART = 1000


def tap(log, folder, first, count):
    """Frames of a long run, slowly enough for the thread that opens the next part."""
    for k in range(first, first + count):
        log.tap(k * 1000, 0x181, k.to_bytes(8, "little"))
        if k % PART == PART // 2:
            wait_until((folder / f"bus-{k // PART + 2:03}.frames").exists)
            wait_until(lambda: log._frames._next is not None)  # noqa: SLF001 (the file is there sooner)


def in_parts(folder, count):
    folder.mkdir(exist_ok=True)
    with BusLog(folder / "bus.asc", STARTED, part_frames=PART) as log:
        tap(log, folder, 0, count)
    return log


def in_one_file(folder, count):
    folder.mkdir()
    return logged(folder, *((k * 1000, 0x181, k.to_bytes(8, "little")) for k in range(count)))


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_a_long_log_is_kept_in_compressed_parts_with_the_digest_of_one_file(tmp_path):
    long, short = tmp_path / "long", in_one_file(tmp_path / "short", 2500)
    log = in_parts(long, 2500)
    assert log.failure is None
    # A part is longer where the thread was too slow to open the next one.
    parts = names(long)
    assert len(parts) > 1
    assert parts == [f"bus-{number:03}.asc.gz" for number in range(1, len(parts) + 1)]
    assert log.digest == short.digest
    whole, other = read_log(long / "bus.asc"), read_log(tmp_path / "short" / "bus.asc")
    assert (whole.count, whole.digest) == (other.count, other.digest)
    assert list(whole.frames()) == list(other.frames())
    assert whole.stated == whole.digest == log.digest


def test_every_part_is_a_log_that_can_tools_read(tmp_path):
    in_parts(tmp_path, 1200)
    seen = []
    for name in names(tmp_path):
        with can.LogReader(tmp_path / name) as reader:
            seen += list(reader)
        *above, last = gzip.decompress((tmp_path / name).read_bytes()).splitlines(keepends=True)
        assert last.split()[-1].decode() == hashlib.sha256(b"".join(above[5:])).hexdigest()
    assert [int.from_bytes(m.data, "little") for m in seen] == list(range(1200))
    assert seen[-1].timestamp - seen[0].timestamp == pytest.approx(1199e-6)


def test_a_killed_long_run_loses_only_its_last_block(tmp_path):
    live, killed = tmp_path / "live", tmp_path / "killed"
    live.mkdir()
    with BusLog(live / "bus.asc", STARTED, part_frames=PART) as log:
        tap(log, live, 0, 2500)
        wait_until((live / "bus.frames.gz").exists)
        wait_until((live / "bus-002.frames.gz").exists)
        shutil.copytree(live, killed, ignore=shutil.ignore_patterns("*.part"))
    (killed / "bus-002.frames.gz.part").write_bytes(b"cut")  # as if killed while compressing
    (killed / "bus-002.frames").write_bytes(
        gzip.decompress((killed / "bus-002.frames.gz").read_bytes())
    )
    assert recover_log(killed) == killed / "bus-001.asc.gz"
    frames = list(read_log(killed / "bus.asc").frames())
    assert len(frames) >= 2 * PART
    assert frames == list(read_log(live / "bus.asc").frames())[: len(frames)]
    assert recover_log(killed) is None
    assert [name for name in names(killed) if "frames" in name] == ["bus-002.frames.gz.part"]


def test_the_next_run_keeps_the_parts_of_a_killed_one(tmp_path):
    made, folder = tmp_path / "made", tmp_path / "run"
    made.mkdir()
    with BusLog(made / "bus.asc", STARTED, part_frames=PART) as log:
        tap(log, made, 0, 1500)
        wait_until((made / "bus.frames.gz").exists)
        shutil.copytree(made, folder, ignore=shutil.ignore_patterns("*.part"))
    (folder / "bus-002.frames").write_bytes(b"")  # killed before its first block
    logged(folder, (0, 0x200, b""))
    assert read_log(folder / "bus-recovered.asc").count == PART
    assert [frame.can_id for frame in read_log(folder / "bus.asc").frames()] == [0x200]


def test_the_cycle_does_not_wait_for_a_compression_that_hangs(tmp_path):
    folder, pipe = tmp_path / "run", tmp_path / "pipe"
    folder.mkdir()
    os.mkfifo(pipe)  # opening it for reading hangs until somebody writes
    first, kept = folder / "bus.frames", tmp_path / "kept"
    with BusLog(folder / "bus.asc", STARTED, part_frames=PART) as log:
        first.rename(kept)
        os.link(pipe, first)
        tap(log, folder, 0, 1500)
        for k in range(1500, 6000):
            log.tap(k * 1000, 0x181, k.to_bytes(8, "little"))
        kept.replace(first)
        (folder / "bus.frames.gz.part").mkdir()  # so the compression that hung comes to nothing
        writer = os.open(pipe, os.O_RDWR)
    os.close(writer)
    assert log.failure is None
    assert log.digest == in_one_file(tmp_path / "short", 6000).digest
    assert read_log(folder / "bus.asc").count == 6000


def test_a_changed_part_and_a_damaged_one_are_noticed(tmp_path):
    log = in_parts(tmp_path, 1500)
    part = tmp_path / "bus-001.asc.gz"
    text = gzip.decompress(part.read_bytes())
    part.write_bytes(gzip.compress(text.replace(b" 03 00 ", b" 04 00 ", 1)))
    changed = read_log(tmp_path / "bus.asc")
    assert changed.digest not in (changed.stated, log.digest)
    part.write_bytes(gzip.compress(text)[:-20])
    with pytest.raises(UnusableInput, match=r"bus-001\.asc\.gz: not a bus log"):
        read_log(tmp_path / "bus.asc")


def test_a_damaged_compressed_spool_is_refused(tmp_path):
    (tmp_path / "bus.frames.gz").write_bytes(gzip.compress(b"stgspool" + bytes(500))[:-20])
    with pytest.raises(UnusableInput, match=r"bus\.frames"):
        recover_log(tmp_path)
    assert names(tmp_path) == ["bus.frames.gz"]
