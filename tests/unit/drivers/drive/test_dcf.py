"""Parameter values from a DCF: written, read back, differences reported."""

import dataclasses
import struct

import pytest

from drivers.errors import ConfigurationError
from drivers.stage import Stage

X, Y = 0, 1


def test_floats_and_strings_of_a_dcf_are_written_too(
    scripted, bus_settings, axis_settings, tmp_path
):
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
