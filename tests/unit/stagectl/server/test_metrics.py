"""What Prometheus gets."""

import pytest

from stagectl.protocol.state import Notice
from stagectl.server.metrics import Metrics


def notice(what, **data):
    return Notice(number=1, time=0.0, kind=what, text="", data=data)


def test_moves_settling_runs_and_alarms_are_counted():
    metrics = Metrics(0)
    metrics.take(notice("move_started", kind="macro"))
    metrics.take(notice("settled", kind="macro", settled=True, duration=0.03))
    metrics.take(notice("settled", kind="macro", settled=False, duration=0.5))
    metrics.take(notice("end", outcome="completed"))
    metrics.take(notice("alarm", id=1, axis="x"))
    metrics.take(notice("alarm", id=1))  # acknowledged
    value = metrics.registry.get_sample_value
    assert value("stagectl_moves_total", {"kind": "macro"}) == 1
    assert value("stagectl_settling_seconds_sum", {"kind": "macro"}) == pytest.approx(0.03)
    assert value("stagectl_not_settled_total") == 1
    assert value("stagectl_runs_total", {"outcome": "completed"}) == 1
    assert value("stagectl_alarms_total") == 1
