"""Offsets chosen from SYNC to SYNC: what the application is told, what is sent, what goes wrong."""

import numpy as np
import pytest

from drivers.errors import AxisFault
from tests.unit.drivers.conftest import rest

X, Y = 0, 1


class Chooser:
    """An `OffsetCorrection` that keeps what it is told.

    Attributes:
        chosen: offsets to send; a row that is no number raises.
        begun: target sent last, and whether the stream continues, of each stream.
        told: row, periods, doubt and positions of each row.
        planned: of the stream [1/1000 rated].
    """

    def __init__(self, chosen=()):
        self.chosen = list(chosen)
        self.begun = []
        self.told = []
        self.planned = np.zeros((0, 2))

    def begin(self, targets, planned, target, continued):
        self.begun.append((list(target), continued))
        self.planned = planned.copy()

    def offsets(self, row, periods, doubt, channels):
        self.told.append((row, periods, doubt, tuple(c.position for c in channels)))
        if not self.chosen:
            return [0, 0]
        value = self.chosen.pop(0)
        return value if isinstance(value, list) else [value + 0, -value]


def test_each_row_gets_its_offsets_after_the_sample_before_it(enabled, scripted):
    chooser = Chooser([1, 2, 3, 4])
    enabled.correct_offsets(chooser)
    position, offset = rest(enabled, 4)
    position[:, X] += np.arange(1, 5) * 1e-8
    offset[:, Y] = 0.1234
    samples = enabled.stream(position, offset)
    np.testing.assert_allclose(samples.force_offset / (0.04, 0.06), [[k, -k] for k in (1, 2, 3, 4)])
    assert scripted.drives[Y].latched[2] == -4
    np.testing.assert_allclose(chooser.planned, np.tile((0.0, 0.1234 / 0.06), (4, 1)))
    assert [told[0] for told in chooser.told] == [0, 1, 2, 3]
    # row k is chosen when the sample of row k - 1's SYNC is there
    seen = [told[3][X] for told in chooser.told]
    counts = (samples.position[:, X] / 1e-9).round().astype(int).tolist()
    assert seen[1:] == counts[:3]


def test_streams_continue_until_something_else_was_sent(enabled, scripted):
    chooser = Chooser()
    enabled.correct_offsets(chooser)
    enabled.stream(*rest(enabled, 3))
    enabled.stream(*rest(enabled, 9), until=lambda _: len(chooser.told) == 5)
    enabled.hold(0.002)
    enabled.enable()  # one SYNC of its own
    enabled.hold(0.002)
    assert [continued for _, continued in chooser.begun] == [False, True, True, False]
    assert [told[0] for told in chooser.told] == [0, 1, 2, 0, 1, 0, 1, 0, 1]
    assert {told[1] for told in chooser.told} == {1}


def test_skipped_periods_are_told(enabled, scripted):
    chooser = Chooser()
    enabled.correct_offsets(chooser)

    def slow(_):
        if len(chooser.told) == 3:
            scripted.clock.now += 3_700_000
        return False

    enabled.stream(*rest(enabled, 6), until=slow)
    assert [told[1] for told in chooser.told] == [1, 1, 1, 1, 3, 1]
    assert [told[2] for told in chooser.told] == [0.0, 0.0, 0.0, 0.0, 0.7, 0.0]


@pytest.mark.parametrize(
    ("wrong", "why"), [("text", "TypeError"), (None, "TypeError"), ([1, 2, 3], "ValueError")]
)
def test_whatever_it_raises_the_last_correction_stays(enabled, scripted, wrong, why):
    chooser = Chooser([5, 7, wrong, 100])
    enabled.correct_offsets(chooser)
    position, offset = rest(enabled, 5)
    offset[:, X] = np.arange(5) * 0.04
    samples = enabled.stream(position, offset)
    # planned 0, 1, 2, 3, 4; from row 1 on it adds 6
    np.testing.assert_allclose(samples.force_offset[:, X] / 0.04, [5, 7, 8, 9, 10])
    assert len(chooser.told) == 3
    assert f"stays as it is: {why}" in enabled.notices[-1]
    held = enabled.stream(*rest(enabled, 2))
    np.testing.assert_allclose(held.force_offset[:, X] / 0.04, 6)
    enabled.correct_offsets(None)
    assert enabled.notices == ()
    assert (enabled.stream(*rest(enabled, 2)).force_offset == 0.0).all()


def test_a_fault_ends_the_stream_as_ever(enabled, scripted):
    chooser = Chooser()
    enabled.correct_offsets(chooser)
    scripted.drives[X].on_sync = lambda drive, count: drive.emergency(0x2310)
    with pytest.raises(AxisFault, match="axis x"):
        enabled.stream(*rest(enabled, 50))
    assert len(chooser.told) < 5
    assert not enabled.enabled
