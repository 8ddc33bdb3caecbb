"""Drives that fix, round or clamp values, get their units from a DCF, or are slow to enable."""

import copy
from collections.abc import Callable

import numpy as np
import pytest
from canopen import SdoAbortedError

from drivers.errors import AxisFault, ConfigurationError, LimitError, NodeError
from hil_sim.bus import faults as f
from hil_sim.cia301 import key
from hil_sim.cia402 import State
from stagectl.config.machine.file import parse_machine
from stagectl.config.settings.package_settings import driver_settings
from tests.hil.test_configuration import dcf, held
from tests.lockstep import open_on, open_stage, switch_on

READ_ONLY, TOO_HIGH, GENERAL = 0x06010002, 0x06090031, 0x08000000
Keeps = Callable[[int], int]


def switched_on(machine, **changes):
    """A stage and drive x, which has its values of after power-on."""
    stage, drives, world = open_stage(machine, **changes)
    world.sleep_until_ns(50_000_000)
    return stage, drives.drives[0], world, drives


def fix(drive, index, value, code=READ_ONLY, sub=0):
    """The object holds this value, and writes are refused."""

    def refuse(_):
        raise SdoAbortedError(code)

    drive.dictionary.values[key(index, sub)] = value
    drive.dictionary.check[key(index, sub)] = refuse


def make(drive, index, keeps, sub=0):
    """The drive makes something of its own of what is written into the object."""
    k, values = key(index, sub), drive.dictionary.values
    values[k] = keeps(values[k])
    then = drive.dictionary.on_write.get(k)

    def keep(value):
        values[k] = keeps(value)
        if then is not None:
            then(keeps(value))

    drive.dictionary.on_write[k] = keep


def test_an_object_fixed_at_the_requested_value_is_not_written(stage_machine):
    stage, drive, _, _ = switched_on(stage_machine)
    for index, value in ((0x605E, 2), (0x605A, 2), (0x6007, 3), (0x607C, 0), (0x6072, 3000)):
        fix(drive, index, value)
    with stage:
        stage.boot()
        assert stage.limitations == ()


@pytest.mark.parametrize(
    ("index", "value", "said"),
    [
        (0x605A, 0, "quick stop option code is 0, not 2: on a quick stop, also when the host is "
                    "lost, it switches the power off and the axis coasts, nothing brakes it"),
        (0x605A, 6, "quick stop option code is 6, not 2: on a quick stop, also when the host is "
                    "lost, it brakes on the quick-stop ramp and holds there"),
        (0x605B, 0, "shutdown option code is 0, not 1: on shutdown it switches the power off"),
        (0x605C, 0, "disable operation option code is 0, not 1: when disabled it switches"),
        (0x605D, 2, "halt option code is 2, not 1: on a halt it brakes on the quick-stop ramp"),
        (0x605E, 0, "fault reaction option code is 0, not 2: on a fault it switches the power"),
        (0x605E, -1, "fault reaction option code is -1, not 2: on a fault the reaction is"),
    ],
)  # fmt: skip
def test_a_fixed_option_code_is_reported(stage_machine, index, value, said):
    code = {0: READ_ONLY, 6: TOO_HIGH}.get(value, GENERAL)  # what drives refuse a write with
    stage, drive, _, _ = switched_on(stage_machine)
    fix(drive, index, value, code)
    with stage:
        stage.boot()
        (limitation,) = stage.limitations
        assert limitation.startswith(f"axis x: 0x{index:04X}:00 {said}")
        assert limitation.endswith(f"(abort 0x{code:08X}))")
        stage.home()
        stage.enable()
        stage.quick_stop()
        assert not stage.enabled


@pytest.mark.parametrize(
    ("index", "sub", "keeps", "said"),
    [
        (0x6085, 0, lambda v: v // 4096 * 4096, "deceleration is 9.99834 m/s^2, not 10 m/s^2: "),
        (0x609A, 0, lambda v: v + 9000, "homing acceleration is 1.009 m/s^2, not 1 m/s^2: "),
        (0x6072, 0, lambda v: v - 1, "max torque is 119.96 N, not 120 N: "),
        (0x6065, 0, lambda v: v + 1, "window is 0.001000001 m, not 0.001 m: "),
        (0x6066, 0, lambda v: v + 1, "following error timeout is 0.011 s, not 0.01 s: "),
        (0x607D, 2, lambda v: v + 100, "max position limit is 0.1500001 m, not 0.15 m: "),
    ],
)
def test_rounded_values_are_accepted_and_reported(stage_machine, index, sub, keeps, said):
    stage, drive, _, _ = switched_on(stage_machine)
    make(drive, index, keeps, sub)
    with stage:
        stage.boot()
        (limitation,) = stage.limitations
        assert limitation.startswith(f"axis x: 0x{index:04X}:{sub:02X} ")
        assert limitation.endswith(f"{said}the drive rounds it")


def test_the_host_uses_values_that_the_drive_has_clamped(stage_machine):
    stage, drive, _, _ = switched_on(stage_machine)
    fix(drive, 0x6072, 500, TOO_HIGH)
    make(drive, 0x6065, lambda v: min(v, 200_000))
    make(drive, 0x607D, lambda v: max(v, -10_000_000), 1)
    make(drive, 0x607D, lambda v: min(v, 20_000_000), 2)
    make(drive, 0x6099, lambda v: min(v, 4_000_000), 1)
    make(drive, 0x6067, lambda v: v * 10)
    with stage:
        stage.boot()
        said = "\n".join(stage.limitations)
        for clause in (
            "axis x: 0x6072:00 max torque is 20 N, not 120 N: there is no more force than that "
            "(write of 3000 refused: Value of parameter written too high (abort 0x06090031))",
            "axis x: 0x6065:00 following error window is 0.0002 m, not 0.001 m: the drive faults "
            "sooner",
            "axis x: 0x607D:02 max position limit is 0.02 m, not 0.15 m: setpoints beyond it",
            "axis x: 0x6099:01 speed during search for switch is 0.004 m/s, not 0.01 m/s: homing "
            "is slower",
            "axis x: 0x6067:00 position window is 1e-05 m, not 1e-06 m: the drive's own moves end",
        ):
            assert clause in said
        has, other = (axis.settings for axis in stage.axes)
        assert (has.peak_force, has.following_error) == pytest.approx((20.0, 2e-4))
        assert has.travel == pytest.approx((-0.01, 0.02))
        assert has.homing_velocity == pytest.approx((4e-3, 2e-3))
        assert other.peak_force == 200.0
        stage.home()
        stage.enable()
        with pytest.raises(LimitError, match=r"^axis x: 0x607D:02 .* above the limit 0\.02 m"):
            stage.stream(np.array([[0.021, 0.0]]), np.zeros((1, 2)))
        with pytest.raises(LimitError, match=r"^axis x: 0x6072:00 .*exceeds the force limit 20 N"):
            stage.stream_force(np.array([[21.0, 0.0], [0.0, 0.0]]))
        # asked for anew at every boot, not from what it was the last time
        del drive.dictionary.check[key(0x6072)]
        stage.boot()
        assert stage.axes[0].settings.peak_force == 120.0


@pytest.mark.parametrize(
    ("index", "sub", "keeps", "error"),
    [
        (0x6072, 0, lambda v: 2 * v, "wrote 3000, the drive holds 6000"),
        (0x6072, 0, lambda v: 0, "wrote 3000, the drive holds 0"),
        (0x6085, 0, lambda v: v // 4, "wrote 10000000, the drive holds 2500000"),
        (0x6065, 0, lambda v: 0xFFFFFFFF, "wrote 1000000, the drive holds 4294967295"),
        (0x607D, 1, lambda v: v - 1000, "wrote -150000000, the drive holds -150001000"),
        (0x607C, 0, lambda v: 1, "wrote 0, the drive holds 1"),
        (0x6098, 0, lambda v: 35, "wrote 37, the drive holds 35"),
    ],
)
def test_values_not_on_the_safe_side_are_refused(stage_machine, index, sub, keeps, error):
    stage, drive, _, _ = switched_on(stage_machine)
    make(drive, index, keeps, sub)
    with (
        stage,
        pytest.raises(ConfigurationError, match=f"^axis x: 0x{index:04X}:{sub:02X} .*") as e,
    ):
        stage.boot()
    assert error in str(e.value)


def test_profile_moves_may_take_as_long_as_the_drive_needs(stage_machine):
    stage, drive, world, _ = switched_on(stage_machine)
    make(drive, 0x6081, lambda v: min(v, 1_000_000))
    make(drive, 0x6083, lambda v: v // 1000 * 1000)
    with stage:
        stage.boot()
        assert stage.limitations == ()
        stage.home()
        stage.enable()
        target, before = stage.targets[0] + 8e-3, world.now_ns
        stage.move_to("x", target, velocity=0.1, acceleration=1.0000005)  # 0.2 s, it needs 8 s
        assert stage.positions[0] == pytest.approx(target, abs=2e-6)
        assert world.now_ns - before > 7_900_000_000
        velocity, acceleration = stage.limitations
        assert velocity == (
            "axis x: 0x6081:00 profile velocity is 0.001 m/s, not 0.1 m/s: the move takes longer"
        )
        assert acceleration.endswith("is 1 m/s^2, not 1.000001 m/s^2: the drive rounds it")
        with stage.profile_moves(0.05, 1.0) as moves:
            moves.to("x", target - 4e-3)
        assert stage.positions[0] == pytest.approx(target - 4e-3, abs=2e-6)
        (velocity,) = stage.limitations  # of the last move
        assert "not 0.05 m/s" in velocity


def test_units_set_by_a_dcf_are_the_ones_checked(stage_machine, tmp_path):
    _, axes = driver_settings(stage_machine)
    k = key(0x608F, 1)
    path = dcf(axes[0], tmp_path, x608Fsub1=32_000_000)
    head, rest = path.read_text().split("[608Fsub1]\n")
    path.write_text(head + "[608Fsub1]\n" + rest.replace("AccessType=ro", "AccessType=rw", 1))
    for file, fits in ((axes[0].eds, False), (path, True)):
        stage, drive, _, _ = switched_on(stage_machine, eds=file)
        writable = copy.copy(drive.dictionary.variables[k])
        writable.access_type = "rw"
        drive.dictionary.variables[k] = writable
        drive.dictionary.values[k] = 1
        with stage:
            if fits:
                stage.boot()
                assert held(stage, 0x608F, 1) == 32_000_000
            else:
                with pytest.raises(ConfigurationError, match="one position unit is"):
                    stage.boot()


def test_values_of_a_dcf_may_be_fixed_or_rounded(stage_machine, tmp_path):
    _, axes = driver_settings(stage_machine)
    path = dcf(axes[0], tmp_path, x605E=2, x6083=1_000_100, x6086=-1)
    stage, drive, _, _ = switched_on(stage_machine, eds=path)
    fix(drive, 0x605E, 2)
    fix(drive, 0x6086, -1)
    make(drive, 0x6083, lambda v: v // 1000 * 1000)
    with stage:
        stage.boot()
        (rounded,) = stage.limitations
    assert "0x6083:00" in rounded
    assert rounded.endswith("is 1000000, not 1000100 as in the DCF: the drive rounds it")


class PhaseFinding:
    """Looks for its commutation angle before OPERATION ENABLED, the first time that it is asked."""

    def __init__(self, drive, world, seconds):
        self._drive, self._world, self._left = drive, world, round(seconds * 1e9)
        self._until = None
        hooks = drive.dictionary.on_write
        self._act = hooks[key(0x6040)]
        hooks[key(0x6040)] = self

    def __call__(self, word):
        if word & 0x0F == 0x0F and self._drive.motion.state is State.SWITCHED_ON:
            if self._until is None:
                self._until = self._world.now_ns + self._left
            if self._world.now_ns < self._until:
                word &= ~0x08
        self._act(word)


def test_phase_finding_may_take_the_enable_timeout(stage_machine):
    text = stage_machine.text.replace(
        "rated_force: 40.0", "enable_timeout: 6 s\n      rated_force: 40.0"
    )
    assert text != stage_machine.text
    stage, drive, world, _ = switched_on(parse_machine(text, "slow.yaml"))
    PhaseFinding(drive, world, 5.0)
    with stage:
        stage.boot()
        before = world.now_ns
        stage.home()
        assert world.now_ns - before > 5_000_000_000
        stage.enable()
        assert stage.enabled


@pytest.mark.parametrize("slow", [0, 1])
def test_each_axis_has_its_own_enable_timeout(stage_machine, slow):
    """The other axis waits, enabled, and is stopped with the one that is late."""
    stage, _, world, drives = switched_on(stage_machine, enable_timeout=6.0)
    PhaseFinding(drives.drives[slow], world, 9.0)
    with stage:
        stage.boot()
        before = world.now_ns
        limit = (6, 2)[slow]
        with pytest.raises(
            AxisFault, match=f"axis {'xy'[slow]}: .*OPERATION ENABLED within {limit} s"
        ):
            stage.home()
        assert limit <= (world.now_ns - before) * 1e-9 < limit + 1.5
        assert not any(d.motion.state is State.ENABLED for d in drives.drives)


def test_a_drive_may_take_its_boot_timeout(stage_machine):
    for timeout, enough in ((2.0, False), (4.0, True)):
        slow = f.Delay(f.Frames(frozenset({0x701}), after=0.03, at_most=1), 3.0, 3.0)
        _, world = switch_on(stage_machine, slow)
        world.sleep_until_ns(50_000_000)
        with open_on(world, stage_machine, boot_timeout=timeout) as stage:
            if enough:
                stage.boot()
            else:
                with pytest.raises(NodeError, match=r"^axis x: no boot-up .* within 2 s"):
                    stage.boot()


def test_another_major_revision_is_accepted_where_required(stage_machine):
    for revision, found in ((None, False), (7, True), (6, False)):
        stage, drive, _, _ = switched_on(stage_machine, revision=revision)
        drive.dictionary.live[key(0x1018, 3)] = lambda: 7 << 16 | 3
        with stage:
            if found:
                stage.boot()
            else:
                said = "the EDS describes 1" if revision is None else "the settings require 6"
                with pytest.raises(NodeError, match=f"major revision is 7, {said}"):
                    stage.boot()
