"""Jobs, command, alarms, the stop button, a jog's demand, who may connect."""

import os
import time
from typing import get_args

import pytest

from stagectl.errors import Aborted, RunFault, StagectlError
from stagectl.protocol.requests import Command
from stagectl.server import command_lease, handlers, motions
from stagectl.server.api import Access
from stagectl.server.command_lease import CommandLease
from stagectl.server.handover import Fault, Handover
from stagectl.server.jobs import Jobs
from stagectl.server.motions import JogDemand
from stagectl.server.notices import Alarms


@pytest.mark.parametrize(
    ("error", "kind"),
    [
        (None, None),
        (Aborted("a"), "stopped"),
        (RunFault("b"), "fault"),
        (StagectlError("c"), "refused"),
        (ZeroDivisionError(), "internal"),
    ],
)
def test_who_waits_is_answered_when_the_job_has_ended(error, kind):
    jobs, answers = Jobs(), []
    job = jobs.begin("homing")
    jobs.wait(job.id, 60.0, answers.append)
    assert answers == []
    jobs.end(job.id, {"at": 1.0}, error)
    assert answers[0].ended
    assert answers[0].kind == kind
    jobs.wait(job.id, 60.0, answers.append)
    assert len(answers) == 2


def test_who_waits_too_long_is_answered_with_the_job_under_way():
    jobs, answers = Jobs(), []
    jobs.wait(jobs.begin("homing").id, 0.0, answers.append)
    assert not answers[0].ended


def test_command_is_held_by_one_and_expires(monkeypatch):
    lease = CommandLease()
    token = lease.take("anna")
    assert lease.renew(token)
    assert not lease.renew("wrong")
    assert not lease.renew(None)
    assert lease.held.holder == "anna"
    other = lease.take("bert")
    assert not lease.renew(token)
    assert not lease.release(token)
    monkeypatch.setattr(command_lease, "KEPT", -1.0)
    assert lease.held is None
    assert not lease.renew(other)


def test_the_stop_button_acts_once_and_is_remembered():
    handover = Handover()
    handover.stop.press("stopped by anna")
    with pytest.raises(Aborted, match="anna"):
        handover.sample((1, 2))
    handover.sample((1, 2))
    assert len(handover.samples) == 2
    assert handover.stop.was_heeded()
    assert not handover.stop.was_heeded()


def test_a_jog_that_nobody_renews_ends(monkeypatch):
    demand = JogDemand(0.01, time.monotonic())
    assert demand.wanted() == 0.01
    monkeypatch.setattr(motions, "LEASE", -1.0)
    assert demand.wanted() == 0.0


@pytest.mark.parametrize("wanted", [0.05, -0.05])
def test_a_jog_slows_down_so_that_it_stops_within_the_travel(wanted):
    travel, slope, period = (-0.01, 0.01), 1.0, 1e-3
    position = velocity = 0.0
    for _ in range(3000):
        allowed = motions.allowed_velocity(position, wanted, slope, travel, period)
        velocity += max(-slope * period, min(slope * period, allowed - velocity))
        position += velocity * period
        assert travel[0] - 1e-9 <= position <= travel[1] + 1e-9
    assert abs(position) > 0.0099


def test_an_alarm_says_what_to_do_and_is_acknowledged_once():
    alarms = Alarms()
    alarm = alarms.take(Fault("x", 0x8611, "axis x: fault", 0.0))
    assert "following error" in alarm.text
    assert "blocks the axis" in alarm.advice
    assert alarms.open == (alarm,)
    assert alarms.acknowledge(alarm.id, "anna").acknowledged_by == "anna"
    assert alarms.acknowledge(alarm.id, "bert") is None
    assert alarms.open == ()


def test_only_this_user_root_and_the_group_are_let_in():
    own = Access(None)
    assert own.allows(f"localhost:{os.getuid()}:5:7")
    assert own.allows("localhost:0:0:7")
    assert not own.allows("localhost:12345:0:7")
    assert not own.allows("somewhere")
    assert not own.allows("localhost:-1:0:7")
    group = Access(os.getgid())
    assert group.allows(f"localhost:12345:{os.getgid()}:7")


def test_every_operation_has_a_function_of_its_name():
    operations = get_args(Command)[0]
    names = [each.model_fields["op"].default for each in get_args(operations)]
    assert len(names) > 20
    assert all(callable(getattr(handlers, name)) for name in names)
