"""What a drive without power says of itself and takes; all that is tried is restored."""

import dataclasses

import pytest

from drivers.canopen import Network, open_bus
from drivers.commissioning.learn import learn
from drivers.errors import NodeError
from hil_sim.cia301 import key
from hil_sim.cia402 import State
from hil_sim.habits import Habits
from stagectl.config.settings.package_settings import driver_settings
from tests.lockstep import switch_on

ALL_MODES = ["pp", "pv", "hm", "csp", "csv", "cst"]


def learned(machine, habits=None, alter=None, node=1):
    """Facts of node 1 by key, what was refused, and what the drive holds otherwise than before."""
    drives, world = switch_on(machine, habits=habits)
    drive = drives.drives[0]
    if alter is not None:
        alter(drive)
    world.sleep_until_ns(100_000_000)
    bus, _ = driver_settings(machine)
    settings = dataclasses.replace(bus, interface="lockstep", channel=world.name)
    before = dict(drive.dictionary.values)
    with open_bus(settings) as opened:
        network = Network(opened, str(settings), beats=False)
        found, refused = learn(network, node)
        network.disconnect()
    after = drive.dictionary.values
    changed = {k for k in before if after[k] != before[k]} - {key(0x6061)}
    return {fact.key: fact.value for fact in found}, refused, changed


@pytest.mark.parametrize(
    ("habits", "expected"),
    [
        (Habits(), {"modes": ALL_MODES, "modes_claimed": 0x3A5, "offset_bits": 16, "tpdos": 4}),
        (Habits(values=((key(0x6502), 0x225),)), {"modes": ALL_MODES, "modes_claimed": 0x225}),
        (Habits(modes=(1, 6)), {"modes": ["pp", "hm"]}),
        (Habits(wide=(key(0x60B2),)), {"offset_bits": 32, "force_bits": 16}),
        (Habits(long_answers=True), {"long_answers": True, "offset_bits": None}),
        (Habits(absent=(key(0x60B2), key(0x6502))),
         {"absent": [0x607E, 0x60B2, 0x60F2, 0x6502], "modes_claimed": None, "modes": ALL_MODES}),
        (Habits(tpdos=1), {"tpdos": 1}),
        (Habits(only=((key(0x60C2, 2), -3),)), {"only": {"0x60C2:02": -3}}),
        (Habits(values=((key(0x1017), 500),), limits=((key(0x1017), 200, 0xFFFF),)),
         {"heartbeat": 0.2}),
    ],
)  # fmt: skip
def test_facts_of_a_drive_and_nothing_changed(habits, expected, stage_machine):
    facts, refused, changed = learned(stage_machine, habits)
    assert {name: facts.get(name) for name in expected} == expected
    assert "only" in expected or "only" not in facts
    assert "heartbeat" in expected or "heartbeat" not in facts
    assert (refused, changed) == ([], set())


def test_what_the_drive_does_not_take_back_is_said(stage_machine):
    def sticks(drive):
        objects = drive.dictionary
        objects.values[key(0x60C2, 2)] = -5
        objects.check[key(0x60C2, 2)] = lambda value: 1 / (value != -5)

    facts, refused, changed = learned(stage_machine, alter=sticks)
    assert refused == ["0x60C2:02 holds -2, was -5"] or refused[0].startswith("0x60C2:02 holds")
    assert changed == {key(0x60C2, 2)}
    assert "only" not in facts


def test_a_drive_under_power_is_left_alone(stage_machine):
    def enabled(drive):
        drive.motion.state = State.ENABLED
        drive.motion._update_statusword()  # noqa: SLF001

    with pytest.raises(NodeError, match=r"^node 1 is in OPERATION ENABLED: disable it first$"):
        learned(stage_machine, alter=enabled)


def test_nobody_there(stage_machine):
    with pytest.raises(NodeError, match=r"^node 9 does not answer SDO$"):
        learned(stage_machine, node=9)
