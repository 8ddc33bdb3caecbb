"""Steps are detected from sums of surprises."""

from estimation.field.change import StepDetector, false_alarm_rate


def test_the_detector_sums_small_surprises_and_begins_anew():
    detector = StepDetector()
    assert [detector.update(z) for z in (2.6, 2.6, 2.6)] == [0, 0, 1]
    assert (detector.up, detector.down) == (0.0, 0.0)
    assert detector.update(-8.0) == -1
    assert false_alarm_rate() * 10_000 < 0.5  # 5 are allowed, and real surprises have tails
