"""Drives that differ harmlessly: they are driven as they are, and each difference is noted once."""

import numpy as np
import pytest
from canopen import SdoAbortedError

from drivers.errors import AxisFault, ConfigurationError
from hil_sim.cia301 import key
from hil_sim.cia402 import State
from stagectl.config import parse_machine
from tests.lockstep import open_on, power_up, switch_on

RANGE, CANNOT_MAP, TOO_LONG = 0x06090030, 0x06040041, 0x06040042


def fixed(drive, *objects):
    """These objects keep what they hold, without a word."""
    for place, value in objects:
        drive.dictionary.values[place] = value
        drive.dictionary.on_write[place] = lambda _, place=place, value=value: (
            drive.dictionary.values.update({place: value})
        )


def refusing(drive, place, code, accepts):
    """The object refuses values that `accepts` does not take."""

    def check(value):
        if not accepts(value):
            raise SdoAbortedError(code)

    drive.dictionary.check[place] = check


@pytest.fixture
def opened(stage_machine):
    """Opens a stage whose axis x has a drive that `alter` has altered."""
    stages = []

    def open_(alter, machine=stage_machine, **settings):
        drives, world = switch_on(machine)
        alter(drives.drives[0])
        stage = open_on(world, machine, **settings)
        stages.append((stage, world))
        return stage, drives.drives[0]

    yield open_
    for stage, _ in stages:
        stage.close()


def moved(stage):
    """The stage is powered up and moves axis x by 50 um in csp."""
    power_up(stage)
    ramp = np.zeros((200, 2))
    ramp[:, 0] = 25e-6 * (1 - np.cos(np.linspace(0, np.pi, 200)))
    samples = stage.stream(np.array(stage.targets) + ramp, np.zeros_like(ramp))
    assert samples.position[-1, 0] - samples.position[0, 0] == pytest.approx(50e-6, abs=3e-6)
    return stage.limitations


def only_ten_thousandths(drive):
    """0x60C2:02 is -3."""
    drive.dictionary.values[key(0x60C2, 2)] = -3
    refusing(drive, key(0x60C2, 2), RANGE, lambda value: value == -3)


def never_maps(*objects):
    def alter(drive):
        mappable = drive.dictionary.mappable

        def refuse(index, *rest, **how):
            if index in objects:
                raise SdoAbortedError(CANNOT_MAP)
            return mappable(index, *rest, **how)

        drive.dictionary.mappable = refuse

    return alter


@pytest.mark.parametrize(
    ("alter", "notes"),
    [
        (
            lambda drive: fixed(drive, (key(0x6066), 0)),
            ["0x6066:00 following error timeout is 0 s, not 0.01 s: the drive faults sooner"],
        ),
        (
            lambda drive: drive.dictionary.values.update({key(0x6076): 40_001}),
            ["0x6076:00 motor rated torque is 40.001 N, not 40 N: forces are off by as much"],
        ),
        (
            lambda drive: fixed(drive, (key(0x607D, 1), 0), (key(0x607D, 2), 0)),
            ["0x607D:02 max position limit is 0, as the lower one: only the host monitors"],
        ),
        (never_maps(0x60B2), ["0x60B2:00 torque offset is not mapped (write of"]),
        (never_maps(0x6077), ["0x6077:00 torque actual value is not mapped (write of"]),
        (
            lambda drive: refusing(drive, key(0x1600, 0), TOO_LONG, lambda n: n <= 2),
            ["0x60B2:00 torque offset is not mapped (write of 3 refused"],
        ),
    ],
    ids=["no timeout", "rounded force", "no limits", "no offset", "no force", "two entries"],
)
def test_a_drive_that_differs_harmlessly_moves_with_a_note(opened, alter, notes):
    stage, _ = opened(alter)
    expected = [f"axis x: {line}" for line in notes]
    found = moved(stage)
    assert len(found) == len(expected), found
    assert all(f.startswith(t) for f, t in zip(found, expected, strict=True)), found


@pytest.mark.parametrize("refuses", [True, False], ids=["refused", "kept"])
def test_can_ids_that_a_drive_has_fixed_are_followed(opened, refuses):
    def alter(drive):
        for place, can_id in ((key(0x1400, 1), 0x2A1), (key(0x1800, 1), 0x1A1)):
            drive.dictionary._defaults[place] = can_id  # noqa: SLF001  as in its EDS
            drive.dictionary.values[place] = can_id
            if refuses:
                refusing(drive, place, RANGE, lambda value, own=can_id: value & 0x7FF == own)
        if not refuses:
            store = drive.dictionary.set_data

            def keep(index, subindex, data, *rest, **how):
                if (index, subindex) in ((0x1400, 1), (0x1800, 1)):
                    own = 0x2A1 if index == 0x1400 else 0x1A1
                    flags = int.from_bytes(data, "little") & ~0x7FF
                    data = (flags | own).to_bytes(4, "little")
                store(index, subindex, data, *rest, **how)

            drive.dictionary.set_data = keep

    stage, _ = opened(alter)
    assert moved(stage) == (
        "axis x: RPDO 1 keeps its CAN-ID 0x2A1, not 0x201",
        "axis x: TPDO 1 keeps its CAN-ID 0x1A1, not 0x181",
    )


def test_a_drive_that_does_not_use_the_cycle_period_has_a_note(opened):
    stage, _ = opened(lambda drive: fixed(drive, (key(0x1006), 0)))
    assert moved(stage) == (
        "axis x: 0x1006:00 communication cycle period is 0 us, not 1000 us: the drive does not "
        "watch SYNC by it",
    )


@pytest.mark.parametrize("ever", [True, False])
def test_a_mode_that_is_displayed_only_when_enabled_is_confirmed_then(opened, ever):
    def alter(drive):
        shown = drive.dictionary.live.get(key(0x6061))
        values = drive.dictionary.values

        def display():
            if not ever or drive.motion.state is not State.ENABLED:
                return 0
            return values[key(0x6061)] if shown is None else shown()

        drive.dictionary.live[key(0x6061)] = display

    stage, drive = opened(alter)
    if ever:
        assert moved(stage) == ()
        return
    with pytest.raises(AxisFault, match=r"^axis x: 0x6061:00 .*shows mode 0 5 s after mode 6"):
        power_up(stage)
    assert drive.motion.state is State.SWITCH_ON_DISABLED


def test_ten_milliseconds_are_written_as_the_drive_takes_them(opened):
    stage, drive = opened(only_ten_thousandths, bus={"sync_period": 10e-3})
    stage.boot()
    assert [drive.dictionary.integer(key(0x60C2, sub)) for sub in (1, 2)] == [10, -3]
    assert stage.limitations == ()


def test_a_period_that_the_drive_cannot_interpolate_over_is_refused(opened):
    def one_ms(drive):
        fixed(drive, (key(0x60C2, 1), 1), (key(0x60C2, 2), -3))

    stage, _ = opened(one_ms, bus={"sync_period": 10e-3})
    with pytest.raises(ConfigurationError, match=r"^axis x: 0x60C2:01 .*over 1 \* 10\^-3 s, SYNC"):
        stage.boot()


def test_a_heartbeat_of_200_ms_only_where_the_machine_file_allows_it(opened, stage_machine):
    def slow(drive):
        refusing(drive, key(0x1017), RANGE, lambda value: value == 0 or value >= 200)

    stage, _ = opened(slow)
    with pytest.raises(ConfigurationError, match=r"^axis x: 0x1017:00 .*heartbeat in its drive"):
        stage.boot()
    text = stage_machine.text.replace(
        "rated_force: 40.0", "heartbeat: 200 ms\n      rated_force: 40.0"
    )
    stage, drive = opened(slow, parse_machine(text, "slow.yaml"))
    assert moved(stage) == ()
    assert drive.dictionary.integer(key(0x1017)) == 200


def test_wrong_modes_of_a_drive_are_corrected_by_the_machine_file(opened, stage_machine):
    def maxon(drive):
        drive.dictionary.values[key(0x6502)] = 0x225  # pp, pv, hm, cst

    stage, _ = opened(maxon)
    stage.boot()
    with pytest.raises(ConfigurationError, match=r"^axis x: 0x6502:00 .*state its modes"):
        stage.require_csp()
    modes = "modes: [pp, hm, csp]\n      rated_force: 40.0"
    text = stage_machine.text.replace("rated_force: 40.0", modes)
    stage, _ = opened(maxon, parse_machine(text, "modes.yaml"))
    assert moved(stage) == ()


def test_a_rated_force_in_other_units(opened):
    def micronewtons(drive):
        drive.dictionary.values[key(0x6076)] = 40_000_000

    stage, _ = opened(micronewtons)
    with pytest.raises(ConfigurationError, match=r"^axis x: 0x6076:00 .*write rated_force_unit$"):
        stage.boot()
    stage, _ = opened(micronewtons, rated_force_unit=1e-6)
    assert moved(stage) == ()


@pytest.mark.parametrize("stops", [False, True])
def test_a_warning_of_a_drive_is_shown_and_stops_only_if_asked_to(opened, stops):
    stage, drive = opened(lambda _: None, **({"warnings": (0x4210,)} if stops else {}))
    power_up(stage)
    emergency = drive.emergency
    emergency._send(0x4210, 0)  # noqa: SLF001  without a fault
    if stops:
        with pytest.raises(Exception, match=r"^axis x: emergency: .*0x4210"):
            stage.hold(0.05)
        return
    stage.hold(0.05)
    assert stage.notices == (
        "axis x: warns: excess device temperature (0x4210), and goes on (error register 0)",
    )
