"""A drive that goes on under power when its host is lost: refused before power, or accepted."""

from contextlib import contextmanager

import pytest
from canopen import SdoAbortedError

from drivers.errors import ConfigurationError
from hil_sim.cia301 import key
from hil_sim.cia402 import State
from tests.lockstep import open_on, power_up, switch_on

CONSUMER, REACTION = key(0x1016, 1), key(0x6007)


def refusing(code):
    def check(value):
        raise SdoAbortedError(code)

    return check


def without_consumer(drive):
    del drive.variables[CONSUMER]


def refuses_consumer(drive):
    drive.check[CONSUMER] = refusing(0x06090030)


def holds_no_action(drive):
    drive.values[REACTION] = 0
    drive.check[REACTION] = refusing(0x06010002)


UNWATCHED = {
    "absent": (without_consumer, "0x1016:01 consumer heartbeat time.* is not offered: "),
    "refused": (refuses_consumer, "0x1016:01 consumer heartbeat time.* refused.*0x06090030"),
    "no action, read-only": (
        holds_no_action,
        "0x6007:00 abort connection option.* is 0, not 3 .*refused",
    ),
}


@pytest.fixture(params=UNWATCHED)
def unwatched(request):
    return UNWATCHED[request.param]


@contextmanager
def opened(machine, change=lambda d: None, **settings):
    """A stage whose drive x was changed; axis x with these settings."""
    drives, world = switch_on(machine)
    change(drives.drives[0].dictionary)
    with open_on(world, machine, **settings) as stage:
        yield stage, drives, world


def test_an_unwatched_host_is_refused_before_power(stage_machine, unwatched):
    change, said = unwatched
    with opened(stage_machine, change) as (stage, drives, _):
        with pytest.raises(ConfigurationError, match=f"^axis x: {said}.*unwatched_host: accept"):
            stage.boot()
        assert drives.drives[0].motion.state is State.SWITCH_ON_DISABLED


def test_an_accepted_unwatched_host_is_powered_and_reported(stage_machine, unwatched):
    change, said = unwatched
    with opened(stage_machine, change, unwatched_host=True) as (stage, _, _):
        stage.boot()
        (clause,) = stage.limitations
        assert clause.startswith(f"axis x: {said[:9]}")
        assert clause.endswith("its host is lost, and stays under power")
        stage.home()
        stage.enable()
        assert stage.enabled


def test_the_drive_goes_on_without_its_host_as_reported(stage_machine):
    with opened(stage_machine, without_consumer, unwatched_host=True) as (stage, drives, world):
        power_up(stage)
        world.sleep_until_ns(world.now_ns + 2_000_000_000)  # nothing of the host meanwhile
        states = [drive.motion.state for drive in drives.drives]
    assert states == [State.ENABLED, State.SWITCH_ON_DISABLED]


def test_a_released_drive_is_pre_operational(stage_machine):
    """Its refusal to watch a host is no reason to leave it sending."""
    with opened(stage_machine, refuses_consumer, unwatched_host=True) as (stage, drives, _):
        stage.boot()
    assert [drive.nmt.state.name for drive in drives.drives] == ["PRE_OPERATIONAL"] * 2
