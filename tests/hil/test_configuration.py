"""Configuration at boot, written and read back: windows, option codes, a DCF."""

import itertools

import canopen
import numpy as np
import pytest

from drivers.errors import AxisFault, ConfigurationError
from drivers.objects import ObjectRef
from hil_sim import CSP_DCF_PATH
from hil_sim.cia301 import key
from stagectl.config.machine.file import parse_machine
from stagectl.config.settings.package_settings import driver_settings
from tests.lockstep import open_stage, power_up


def held(stage, index, sub=0):
    return stage.axes[0].node.read(ObjectRef(index, sub, ""))


def test_windows_and_option_codes_of_the_machine_file(stage_machine):
    text = stage_machine.text.replace(
        "following_error: 0.001}",
        "following_error: 0.001, following_error_time: 20 ms, position_window: 2 um, "
        "position_window_time: 30 ms}",
    ).replace("rated_force: 40.0", "options: {quick_stop: 6, halt: 2}\n      rated_force: 40.0")
    stage, _, _ = open_stage(parse_machine(text, "options.yaml"))
    with stage:
        stage.boot()
        assert [held(stage, i) for i in (0x6066, 0x6067, 0x6068)] == [20, 2000, 30]
        assert [held(stage, i) for i in (0x605A, 0x605B, 0x605C, 0x605D, 0x605E)] == [6, 1, 1, 2, 2]
        assert held(stage, 0x6007) == 3
        stage.home()
        stage.enable()
        stage.quick_stop()  # stays in QUICK STOP ACTIVE, and is switched off then
        assert not stage.enabled
        stage.enable()
        assert stage.enabled


def dcf(settings, folder, **values):
    """The axis' EDS with values of its own for some objects."""
    text = settings.eds.read_text()
    for name, value in values.items():
        head, _, rest = text.partition(f"[{name[1:]}]\n")
        assert rest, name
        text = f"{head}[{name[1:]}]\nParameterValue={value}\n{rest}"
    path = folder / "drive.dcf"
    path.write_text(text)
    return path


def test_a_dcf_is_written_except_for_objects_of_the_driver(stage_machine, tmp_path):
    _, axes = driver_settings(stage_machine)
    path = dcf(axes[0], tmp_path, x6081=123456, x6067=77, x1017=9999, x607A=5)
    stage, _, _ = open_stage(stage_machine, eds=path)
    with stage:
        stage.boot()
        assert held(stage, 0x6081) == 123456
        assert held(stage, 0x6067) == 1000  # the machine file's
        assert held(stage, 0x1017) == 100
        assert held(stage, 0x607A) == 0


def test_the_pdos_of_a_booted_drive_are_those_of_the_dcf_for_csp(stage_machine):
    stage, drives, _ = open_stage(stage_machine)
    with stage:
        stage.boot()
        for drive in drives.drives:
            dictionary = canopen.import_od(str(CSP_DCF_PATH), drive.node_id)
            expected = {
                (v.index, v.subindex): v.default if v.value is None else v.value
                for index in dictionary
                if 0x1400 <= index < 0x1C00
                for v in dictionary[index].values()
            }
            assert len(expected) > 100
            assert {k: drive.dictionary.integer(key(*k)) for k in expected} == expected


def test_all_differences_from_a_dcf_are_one_error(stage_machine, tmp_path):
    _, axes = driver_settings(stage_machine)
    path = dcf(axes[0], tmp_path, x6081=123456, x6083=1000, x6084=2000)
    stage, drives, _ = open_stage(stage_machine, eds=path)
    dictionary = drives.drives[0].dictionary
    del dictionary.variables[0x608100]
    dictionary.live[0x608400] = lambda: 42
    with stage:
        with pytest.raises(ConfigurationError) as caught:
            stage.boot()
        text = str(caught.value)
    assert text.startswith("axis x: DCF: 2 of 3 objects differ: 0x6081:00 ")
    assert "does not exist" in text
    assert "0x6084:00 " in text
    assert "wrote 2000, the drive holds 42" in text
    assert "0x6083" not in text


def test_a_drive_that_produces_sync_or_consumes_another_id_is_corrected(stage_machine):
    stage, drives, world = open_stage(stage_machine)
    world.sleep_until_ns(50_000_000)
    drives.drives[0].dictionary.values[0x100500] = 0x4000_0085
    with stage:
        stage.boot()
        assert held(stage, 0x1005) == 0x80
        stage.home()


@pytest.mark.parametrize(
    ("pause_ns", "said"),
    [
        (12_600_000, "0x8611.*the host had just stalled for 11 SYNC periods"),
        (1_500_000_000, r"0x8130.*the host had just stalled for 1\.5 s"),
    ],
)
def test_a_fault_after_late_syncs_names_the_stall(stage_machine, pause_ns, said):
    """At 0.5 m/s a demand that stands still for 12 ms is a following error by itself."""
    stage, _, world = open_stage(stage_machine)
    with stage:
        power_up(stage)
        speed = np.r_[np.linspace(0, 0.5, 100), np.full(100, 0.5), np.linspace(0.5, 0, 100)]
        position = np.array(stage.targets) + np.cumsum(speed)[:, None] * 1e-3 * [1, 0]
        count = itertools.count()

        def until(_):
            if next(count) == 150:
                world.sleep_until_ns(world.now_ns + pause_ns)
            return False

        with pytest.raises(AxisFault, match=f"^axis .: .*{said}"):
            stage.stream(position, np.zeros_like(position), until)
