"""Objects of a node by SDO: EDS files, values that do not stay written, aborts."""

import dataclasses

import pytest

from drivers.canopen import load_dictionary
from drivers.errors import ConfigurationError, NodeError
from drivers.stage import Stage

X, Y = 0, 1


def test_an_unusable_eds_is_named_with_the_reason(tmp_path, axis_settings):

    missing = dataclasses.replace(axis_settings[0], eds=tmp_path / "none.eds")
    with pytest.raises(ConfigurationError, match=r"^axis x: EDS file .*none.eds: no such file"):
        load_dictionary(missing)
    broken = tmp_path / "broken.eds"
    for text in ("", "not an eds\n", "[1018]\nObjectType=potato\n", "[DeviceInfo]\n"):
        broken.write_text(text)
        with pytest.raises(ConfigurationError, match=r"^axis x: EDS file .*broken.eds: ."):
            load_dictionary(dataclasses.replace(axis_settings[0], eds=broken))


def test_a_value_that_reads_back_differently_is_an_error(scripted, bus_settings, axis_settings):
    scripted.drives[Y].stuck.add((0x6065, 0))
    with (
        Stage.open(bus_settings, axis_settings, bus_object=scripted) as stage,
        pytest.raises(
            ConfigurationError,
            match=r"^axis y: 0x6065:00 following error window: wrote 1000000, the drive holds 0",
        ),
    ):
        stage.boot()


def test_an_sdo_abort_names_object_value_and_reason(scripted, bus_settings, axis_settings):
    scripted.drives[X].refuse_write[0x6072, 0] = 0x06090031
    with Stage.open(bus_settings, axis_settings, bus_object=scripted) as stage:
        with pytest.raises(NodeError) as caught:
            stage.boot()
        assert caught.value.abort_code == 0x06090031
        assert str(caught.value) == (
            "axis x: 0x6072:00 max torque: write of 3000 refused: Value of parameter written "
            "too high (abort 0x06090031); the drive holds 0"
        )


def test_an_optional_object_that_the_drive_lacks_is_skipped(scripted, bus_settings, axis_settings):
    scripted.drives[X].refuse[0x6007, 0] = 0x06020000
    with Stage.open(bus_settings, axis_settings, bus_object=scripted) as stage:
        stage.boot()
        stage.enable()
        assert stage.enabled
