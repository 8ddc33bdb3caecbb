"""What a drive is to do without its host: written, read back, and judged by what it holds."""

import pytest

from drivers import objects as od
from drivers.drive.host_loss import watch_host
from drivers.errors import NodeError

QUICK_STOP = 3


@pytest.fixture
def clauses():
    return []


def watched(stage, clauses):
    return watch_host(stage.axes[0].node, QUICK_STOP, clauses.append)


def test_a_drive_that_watches_no_heartbeat_at_all_does_not_notice(stage, scripted, clauses):
    """Some keep 0x1016:01 and watch nothing: their number of entries is 0."""
    scripted.drives[0].objects[0x1016, 0] = 0
    ref, why = watched(stage, clauses)
    assert ref == od.HEARTBEAT_CONSUMER
    assert why.startswith("0x1016:00 number of heartbeats watched is 0: ")


@pytest.mark.parametrize(
    ("held", "reaction"),
    [
        (1, "without its host it faults"),
        (2, "it switches the power off and the axis coasts, nothing brakes it"),
        (-1 & 0xFFFF, "the reaction is manufacturer specific"),
    ],
)
def test_another_reaction_is_a_limitation(stage, scripted, clauses, held, reaction):
    scripted.drives[0].objects[0x6007, 0] = held
    scripted.drives[0].stuck.add((0x6007, 0))
    assert watched(stage, clauses) is None
    (clause,) = clauses
    assert clause.startswith("0x6007:00 abort connection option code is ")
    assert clause.endswith(reaction)


def test_silence_is_an_error(stage, scripted, clauses):
    scripted.drives[0].silent = True
    with pytest.raises(NodeError, match=r"axis x: 0x1016:01 .*node 1 does not answer"):
        watched(stage, clauses)
