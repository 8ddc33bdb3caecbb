"""Objects of a node by SDO: EDS files, values that do not stay written, aborts."""

import dataclasses

import pytest

from drivers import objects as od
from drivers.canopen import load_dictionary
from drivers.errors import ConfigurationError, NodeError
from drivers.objects import ObjectRef

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


def test_a_value_that_reads_back_differently_is_an_error(stage, scripted):
    scripted.drives[Y].stuck.add((0x1017, 0))
    node = stage.axes[Y].node
    text = r"^axis y: 0x1017:00 producer heartbeat time: wrote 70, the drive holds 100$"
    for write in (node.write_checked, node.write_optional):
        with pytest.raises(ConfigurationError, match=text):
            write(od.HEARTBEAT_PRODUCER, 70)


@pytest.mark.parametrize(("code", "found"), [(0x06020000, None), (0x08000000, None), (0, 0x8611)])
def test_an_optional_object_is_read_where_the_node_has_it(stage, scripted, code, found):
    scripted.drives[X].objects[0x603F, 0] = 0x8611
    scripted.drives[X].refuse[0x603F, 0] = code
    assert stage.axes[X].node.read_if_offered(od.ERROR_CODE) == found
    assert stage.axes[X].node.read_if_offered(ObjectRef(0x5FFF, 0, "")) is None
    scripted.drives[X].silent = True
    with pytest.raises(NodeError, match="does not answer"):
        stage.axes[X].node.read_if_offered(od.ERROR_CODE)


def test_an_sdo_abort_names_object_value_and_reason(opened, scripted):
    scripted.drives[X].refuse_write[0x6072, 0] = 0x06090031
    with opened:
        with pytest.raises(NodeError) as caught:
            opened.boot()
        assert caught.value.abort_code == 0x06090031
        assert str(caught.value) == (
            "axis x: 0x6072:00 max torque: write of 3000 refused: Value of parameter written "
            "too high (abort 0x06090031); the drive holds 0"
        )
