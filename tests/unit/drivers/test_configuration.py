"""What a stage sets its drives up with, on a scripted bus, and what it says when they refuse."""

from __future__ import annotations

import dataclasses
import struct
from typing import Any

import numpy as np
import pytest

from drivers.drive import Mode
from drivers.errors import (
    ConfigurationError,
    NodeError,
    shown,
)
from drivers.settings import AxisSettings, BusSettings
from drivers.stage import Stage
from tests.unit.drivers.conftest import rest

X, Y = 0, 1


def test_boot_maps_one_64_bit_pdo_each_way_and_disables_the_others(
    stage: Stage, scripted: Any
) -> None:
    held = scripted.drives[X].objects
    assert [held[0x1600, i] for i in range(4)] == [3, 0x60400010, 0x607A0020, 0x60B20010]
    assert [held[0x1A00, i] for i in range(4)] == [3, 0x60410010, 0x60640020, 0x60770010]
    assert (held[0x1400, 1], held[0x1800, 1]) == (0x201, 0x181)
    assert (held[0x1400, 2], held[0x1800, 2]) == (1, 1)
    assert held[0x1016, 1] == 127 << 16 | 500
    assert held[0x1017, 0] == 100
    assert (held[0x60C2, 1], struct.pack("b", -3)[0]) == (1, held[0x60C2, 2])
    assert (held[0x607D, 1], held[0x607D, 2]) == (2**32 - 150_000_000, 150_000_000)
    assert held[0x6065, 0] == 1_000_000
    assert scripted.drives[Y].objects[0x6072, 0] == 3333


def test_mapping_is_written_while_invalid_and_count_zero(stage: Stage, scripted: Any) -> None:
    writes = [w for w in scripted.drives[X].writes if w[0] in (0x1600, 0x1400)]
    kinds = [(i, s) for i, s, _ in writes]
    first, last = kinds.index((0x1600, 1)), kinds.index((0x1600, 3))
    assert writes[0][:2] == (0x1400, 1)
    assert writes[0][2] >> 31 == 1
    assert writes[first - 1] == (0x1600, 0, 0)
    assert writes[last + 1] == (0x1600, 0, 3)
    assert writes[-1] == (0x1400, 1, 0x201)


def test_missing_node_is_named(
    scripted: Any, bus_settings: BusSettings, axis_settings: tuple[AxisSettings, ...]
) -> None:
    scripted.drives[Y].silent = True
    with (
        Stage.open(bus_settings, axis_settings, bus_object=scripted) as stage,
        pytest.raises(NodeError, match=r"^axis y: no boot-up message from node 2 within 2 s"),
    ):
        stage.boot()


@pytest.mark.parametrize(
    ("key", "value", "error", "text"),
    [
        ((0x1018, 1), 0x22, NodeError, r"^axis x: 0x1018:01 vendor id: is 0x00000022, the EDS"),
        ((0x1018, 2), 0x99, NodeError, r"^axis x: 0x1018:02 product code: is 0x00000099"),
        ((0x1018, 3), 0x30000, NodeError, r"0x1018:03 .*major revision is 3, the EDS describes 1"),
        ((0x1000, 0), 0x191, NodeError, r"^axis x: 0x1000:00 device type: is profile 401"),
        ((0x6076, 0), 39000, ConfigurationError, r"0x6076:00 .*says 39 N, the settings 40 N"),
        ((0x6092, 1), 1000, ConfigurationError, r"0x6092:01 feed: factor group: .* 0.001 encoder"),
        ((0x6502, 0), 0x21, ConfigurationError, r"0x6502:00 .*cyclic synchronous position"),
    ],
)
def test_a_drive_that_is_not_the_expected_one_is_refused(
    scripted: Any, bus_settings: BusSettings, axis_settings: tuple[AxisSettings, ...],
    key: tuple[int, int], value: int, error: type[Exception], text: str,
) -> None:  # fmt: skip
    scripted.drives[X].objects[key] = value
    with (
        Stage.open(bus_settings, axis_settings, bus_object=scripted) as stage,
        pytest.raises(error, match=text),
    ):
        stage.boot()


def test_a_value_that_does_not_stay_written_is_found(
    scripted: Any, bus_settings: BusSettings, axis_settings: tuple[AxisSettings, ...]
) -> None:
    scripted.drives[Y].stuck.add((0x6065, 0))
    with (
        Stage.open(bus_settings, axis_settings, bus_object=scripted) as stage,
        pytest.raises(
            ConfigurationError,
            match=r"^axis y: 0x6065:00 following error window: wrote 1000000, the drive holds 0",
        ),
    ):
        stage.boot()


def test_a_mapping_that_does_not_stay_written_is_found(
    scripted: Any, bus_settings: BusSettings, axis_settings: tuple[AxisSettings, ...]
) -> None:
    scripted.drives[X].stuck.add((0x1600, 3))
    with (
        Stage.open(bus_settings, axis_settings, bus_object=scripted) as stage,
        pytest.raises(ConfigurationError, match=r"axis x: 0x1600:03 .*0x60B2:00 torque offset"),
    ):
        stage.boot()


def test_an_sdo_abort_names_object_value_and_reason(
    scripted: Any, bus_settings: BusSettings, axis_settings: tuple[AxisSettings, ...]
) -> None:
    scripted.drives[X].refuse_write[0x6072, 0] = 0x06090031
    with Stage.open(bus_settings, axis_settings, bus_object=scripted) as stage:
        with pytest.raises(NodeError) as caught:
            stage.boot()
        assert caught.value.abort_code == 0x06090031
        assert str(caught.value) == (
            "axis x: 0x6072:00 max torque: write of 3000 refused: Value of parameter written "
            "too high (abort 0x06090031); the drive holds 0"
        )


def test_a_mode_that_is_refused_is_named_by_its_number(
    scripted: Any, bus_settings: BusSettings, axis_settings: tuple[AxisSettings, ...]
) -> None:
    with Stage.open(bus_settings, axis_settings, bus_object=scripted) as stage:
        stage.boot()
        scripted.drives[X].refuse[0x6060, 0] = 0x06090030
        with pytest.raises(NodeError, match=r"^axis x: 0x6060:00 [a-z ]+: write of 8 refused: "):
            stage.enable()


@pytest.mark.parametrize(
    ("value", "text"),
    [(Mode.HOMING, "6"), (np.float64(0.5), "0.5"), (b"\x01\xff", "01 FF"), ("a", '"a"')],
)
def test_values_are_written_as_people_write_them(value: Any, text: str) -> None:
    assert shown(value) == text


def test_an_object_that_the_drive_does_without_is_passed_over(
    scripted: Any, bus_settings: BusSettings, axis_settings: tuple[AxisSettings, ...]
) -> None:
    scripted.drives[X].refuse[0x6007, 0] = 0x06020000
    with Stage.open(bus_settings, axis_settings, bus_object=scripted) as stage:
        stage.boot()
        stage.enable()
        assert stage.enabled


def test_two_axes_on_one_node_are_refused(
    scripted: Any, bus_settings: BusSettings, axis_settings: tuple[AxisSettings, ...]
) -> None:
    with pytest.raises(ConfigurationError, match=r"axis x: node 1 is axis x's already"):
        Stage.open(bus_settings, (axis_settings[0], axis_settings[0]), bus_object=scripted)


def test_a_reboot_sets_everything_up_anew(stage: Stage, scripted: Any) -> None:
    stage.enable()
    stage.boot()
    assert not stage.enabled
    stage.enable()
    assert len(stage.stream(*rest(stage, 3))) == 3


def test_an_eds_without_force_offset_leaves_it_out_of_the_rpdo(
    scripted: Any, bus_settings: BusSettings, axis_settings: tuple[AxisSettings, ...], tmp_path: Any
) -> None:
    text = axis_settings[0].eds.read_text()
    head, rest_ = text.split("[60B2]")
    other = tmp_path / "without.eds"
    other.write_text(head + rest_[rest_.index("\n[") :])
    axes = (dataclasses.replace(axis_settings[0], eds=other), axis_settings[1])
    with Stage.open(bus_settings, axes, bus_object=scripted) as stage:
        stage.boot()
        assert [scripted.drives[n].objects[0x1600, 0] for n in (X, Y)] == [2, 3]
        assert stage.limitations == (
            "axis x: 0x60B2:00 torque offset is not offered: force offsets are not sent",
        )


def test_a_mapping_of_more_than_64_bits_names_the_eds(
    scripted: Any, bus_settings: BusSettings, axis_settings: tuple[AxisSettings, ...], tmp_path: Any
) -> None:
    before, entry = axis_settings[0].eds.read_text().split("[6064]")
    other = tmp_path / "wide.eds"
    other.write_text(before + "[6064]" + entry.replace("DataType=0x0004", "DataType=0x0015", 1))
    axes = (dataclasses.replace(axis_settings[0], eds=other), axis_settings[1])
    with pytest.raises(ConfigurationError, match=r"^axis x: EDS file .*wide\.eds: a PDO carries 8"):
        Stage.open(bus_settings, axes, bus_object=scripted)


def test_numbers_and_texts_of_a_dcf_are_written_too(
    scripted: Any, bus_settings: BusSettings, axis_settings: tuple[AxisSettings, ...], tmp_path: Any
) -> None:
    text = axis_settings[0].eds.read_text()
    for index, data_type, value in (("2100", "0x0008", "0.1"), ("2101", "0x0009", "fine")):
        text += f"\n[{index}]\nParameterName=gain\nObjectType=0x7\nDataType={data_type}\n"
        text += f"AccessType=rw\nParameterValue={value}\nPDOMapping=0\n"
    other = tmp_path / "drive.dcf"
    other.write_text(text)
    axes = (dataclasses.replace(axis_settings[0], eds=other), axis_settings[1])
    drive = scripted.drives[X]
    with Stage.open(bus_settings, axes, bus_object=scripted) as stage:
        stage.boot()
        assert struct.pack("<I", drive.objects[0x2100, 0]) == struct.pack("<f", 0.1)
        assert struct.pack("<I", drive.objects[0x2101, 0]) == b"fine"
        drive.stuck.add((0x2100, 0))
        drive.objects[0x2100, 0] = 0
        with pytest.raises(
            ConfigurationError, match=r"DCF: 1 of 2 .*0x2100:00 gain wrote 0\.1, .* holds 0$"
        ):
            stage.boot()
