"""Journals as runs write them."""

from stagectl.store import AxisScaling, Journal, JournalHeader
from stagectl.store.journal_reader import parse_journal
from stagedata import Move

HEADER = JournalHeader(
    "machine: µ\n",
    "recipe: r\n",
    "2026-11-02T08:00:00+00:00",
    (AxisScaling("x", 1e-9, 0.04), AxisScaling("y", 1e-8, 0.06)),
)


TEN_S = 10_000_000_000


EXTRA = {6: 1, 10: 2}
"""TPDOs of y in addition, reported with the sample after: a double of 5; of 9, late and twice."""


def sample(k):
    """Sample k; the TPDO of y misses every tenth SYNC."""
    missed = k % 10 == 9
    return (
        TEN_S + k * 1_000_000, k == 4, 10 * k, -1 if k == 5 else 20,
        -k, 25, -k + 1, -26, 4663, True, 200_000, 0,
        2 * k, 0, 2 * k, 1, 0x1237, not missed, -1 if missed else 300_000, EXTRA.get(k, 0),
    )  # fmt: skip


def move(kind, start, end, site=1):
    return Move(kind, start, end, {"x": 0.0, "y": 0.0}, {"x": 1e-6, "y": -1e-6}, site)


def content_of(journal):
    """What is read back of a journal, closed now."""
    journal.close()
    content = parse_journal(journal.path.read_bytes(), journal.path)
    return content


def written(folder, count=30):
    """A journal with `count` samples, an event before each fifth, two moves."""
    journal = Journal(folder, HEADER)
    for k in range(count):
        if k == 3:
            journal.move(move("macro", 3, 12))
        if k == 20:
            journal.move(move("micro", 20, 90))
        if k % 5 == 0:
            journal.event("phase", number=k)
        journal.sink(sample(k))
    return journal
