"""Configuration of an axis on a scripted bus: PDO mappings, modes, interpolation period."""

import dataclasses
import struct

import pytest

from drivers.drive.axis import interpolation_period
from drivers.errors import ConfigurationError, NodeError
from drivers.stage import Stage

X, Y = 0, 1


def test_boot_maps_one_64_bit_pdo_each_way_and_disables_the_others(stage, scripted):
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


def test_a_mapping_that_reads_back_differently_is_an_error(opened, scripted):
    scripted.drives[X].stuck.add((0x1600, 3))
    with (
        opened,
        pytest.raises(ConfigurationError, match=r"axis x: 0x1600:03 .*0x60B2:00 torque offset"),
    ):
        opened.boot()


def test_a_mode_that_is_refused_is_named_by_its_number(opened, scripted):
    with opened:
        opened.boot()
        scripted.drives[X].refuse[0x6060, 0] = 0x06090030
        with pytest.raises(NodeError, match=r"^axis x: 0x6060:00 [a-z ]+: write of 8 refused: "):
            opened.enable()


def test_an_eds_without_force_offset_leaves_it_out_of_the_rpdo(
    scripted, bus_settings, axis_settings, tmp_path
):
    text = axis_settings[0].eds.read_text()
    head, rest_ = text.split("[60B2]")
    other = tmp_path / "without.eds"
    other.write_text(head + rest_[rest_.index("\n[") :])
    axes = (dataclasses.replace(axis_settings[0], eds=other), axis_settings[1])
    with Stage.open(bus_settings, axes, bus_object=scripted) as stage:
        stage.boot()
        assert [scripted.drives[n].objects[0x1600, 0] for n in (X, Y)] == [2, 3]
        assert stage.limitations == (
            "axis x: 0x60B2:00 torque offset is not offered: nothing is compensated",
        )


def test_a_mapping_of_more_than_64_bits_names_the_eds(
    scripted, bus_settings, axis_settings, tmp_path
):
    before, entry = axis_settings[0].eds.read_text().split("[6064]")
    other = tmp_path / "wide.eds"
    other.write_text(before + "[6064]" + entry.replace("DataType=0x0004", "DataType=0x0015", 1))
    axes = (dataclasses.replace(axis_settings[0], eds=other), axis_settings[1])
    with pytest.raises(ConfigurationError, match=r"^axis x: EDS file .*wide\.eds: a PDO carries 8"):
        Stage.open(bus_settings, axes, bus_object=scripted)


@pytest.mark.parametrize("period_us", [1000, 2000, 2500, 250, 125, 4000, 10_000, 1_000_000])
def test_interpolation_period_is_the_sync_period(period_us):
    value, index = interpolation_period(period_us)
    assert 0 < value <= 255
    assert value * 10 ** (index + 6) == pytest.approx(period_us)


def test_a_period_without_interpolation_value_is_named():
    with pytest.raises(ConfigurationError, match=r"0x60C2:01 .*1234 us"):
        interpolation_period(1234)
