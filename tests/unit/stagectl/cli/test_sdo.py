"""`stagectl sdo`: objects read and written by hand, on drives in virtual and in real time."""

import json

import can
import pytest

from stagectl.errors import RunFault, StagectlError, UnusableInput
from tests.unit.stagectl.cli.conftest import enabled


def test_a_value_comes_with_unit_type_and_name(call):
    failure, out, _ = call("sdo", "get", "x", "0x6065", "--simulate")
    assert failure == 0
    assert out == "0x6065:00 Following error window [nm]: 1000000 = 1 mm  [UNSIGNED32, rw]\n"
    _, out, _ = call("sdo", "get", "2", "6041", "--simulate")
    assert out == "0x6041:00 Statusword: 0x0250 = off, no force  [UNSIGNED16, ro]\n"


def test_without_a_sub_index_all_are_read_as_json_too(call):
    failure, out, _ = call("sdo", "get", "y", "0x607D", "--simulate", "--json", "-")
    assert failure == 0
    entries = json.loads(out)
    assert [e["object"] for e in entries] == ["0x607D:00", "0x607D:01", "0x607D:02"]
    assert entries[2]["axis"] == "y"
    assert (entries[2]["value"], entries[2]["unit"]) == (150_000_000, "m")
    assert entries[2]["si"] == pytest.approx(0.15)
    assert entries[0]["si"] is None


@pytest.mark.parametrize(
    ("obj", "value", "held", "si"),
    [
        ("0x6065", "0.5mm", 500_000, 5e-4),
        ("0x607C", "-1000", -1000, -1e-6),
        ("0x6081", "20 mm/s", 20_000_000, 0.02),
        ("0x6099:01", "20mm/s", 20_000_000, 0.02),
        ("0x6066", "15ms", 15, 0.015),
        ("0x605A", "6", 6, None),
    ],
)
def test_a_value_is_written_and_read_back(call, obj, value, held, si):
    failure, out, _ = call("sdo", "set", "x", obj, value, "--simulate", "--json", "-")
    assert failure == 0
    entry = json.loads(out)
    assert entry["value"] == held
    assert entry["before"] != held
    assert entry["si"] == (None if si is None else pytest.approx(si))


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (("get", "z", "0x6041"), "no axis or node 'z'; there are x (node 1), y (node 2)"),
        (("get", "x", "statusword"), "'statusword' is no object, such as 0x6064"),
        (("get", "x", "0x5FFF"), "0x5FFF is not in stagectl-linear-drive.eds"),
        (("get", "x", "0x6099:07"), "stagectl-linear-drive.eds has the sub-indices 00, 01, 02"),
        (("set", "x", "0x6099", "1"), "0x6099: stagectl-linear-drive.eds has the sub-indices"),
        (("set", "x", "0x6065", "5N"), "must be a length"),
        (("set", "x", "0x6041", "0"), "the EDS says read-only"),
        (("set", "x", "0x6040", "0x0F"), "commands the drive; --yes writes it"),
    ],
)
def test_what_cannot_be_is_refused_before_any_bus_is_opened(call, arguments, reason):
    # this bus cannot be opened: coming to it would be another error
    failure, _, err = call("sdo", *arguments, "--bus", "no_such_interface:0")
    assert reason in (str(failure) if isinstance(failure, UnusableInput) else err)
    assert failure == 2 or isinstance(failure, UnusableInput)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ("set x 0x6060 99 --simulate", "axis x: 0x6060:00 Modes of operation: write of 99 refused"),
        ("get y 0x6064 --bus virtual:no", "axis y: 0x6064:00 Position actual value [nm]: read: "),
    ],
    ids=["the drive refuses", "it does not answer"],
)
def test_a_failure_names_axis_and_object(call, arguments, said):
    failure, _, _ = call("sdo", *arguments.split())
    assert isinstance(failure, RunFault)
    assert said in str(failure)


def test_a_drive_that_holds_another_value_is_an_error(call, odd_drives):
    (drive, _), bus = odd_drives
    values = drive.dictionary.values
    drive.dictionary.on_write[0x606500] = lambda value: values.update({0x606500: value // 2})
    failure, out, _ = call("sdo", "set", "x", "0x6065", "1000", "--bus", bus)
    assert type(failure) is StagectlError
    assert str(failure).endswith("wrote 1000, the drive holds 500")
    assert "500 = 0.0005 mm" in out


def test_a_drive_that_counts_in_other_units_gets_and_shows_no_others(call, odd_drives):
    (drive, _), bus = odd_drives
    drive.dictionary.values[0x60A900] = 0x00B44700  # revolutions per minute
    failure, out, err = call("sdo", "get", "x", "0x6081", "--bus", bus)
    assert failure == 0
    assert out == "0x6081:00 Profile velocity [nm/s]: 100000000  [UNSIGNED32, rw]\n"
    assert err.startswith("axis x: 0x60A9:00 ")
    failure, _, _ = call("sdo", "set", "x", "0x6081", "5mm/s", "--bus", bus)
    assert isinstance(failure, UnusableInput)
    assert str(failure).endswith("give VALUE in the drive's unit")
    assert drive.dictionary.values[0x608100] == 100_000_000
    failure, out, _ = call("sdo", "set", "x", "0x6081", "60", "--bus", bus)
    assert failure == 0
    assert out == "0x6081:00 Profile velocity [nm/s]: 60  [UNSIGNED32, rw] (was 100000000)\n"


@pytest.fixture
def where(served_drives):
    return "--bus", f"{served_drives['interface']}:{served_drives['channel']}"


@pytest.mark.real_time
def test_an_enabled_axis_is_written_only_with_yes(call, served_drives, where):
    set_window = "sdo", "set", "x", "0x6065", "2mm", *where
    with can.Bus(**served_drives) as bus:
        enabled(bus, node=1)
        failure, _, _ = call(*set_window)
        assert isinstance(failure, UnusableInput)
        assert "axis x: is in OPERATION ENABLED, under force" in str(failure)
        assert "= 1 mm" in call("sdo", "get", "x", "0x6065", *where)[1]
        failure, out, _ = call(*set_window, "--yes")
        assert failure == 0
        assert "2000000 = 2 mm  [UNSIGNED32, rw] (was 1000000)" in out
        # the other axis has no force
        assert call("sdo", "set", "y", "0x6065", "2mm", *where)[0] == 0


@pytest.mark.real_time
def test_a_bus_with_a_host_is_read_but_not_written(call, served_drives, where):
    beat = can.Message(arbitration_id=0x77F, data=[5], is_extended_id=False)
    with can.Bus(**served_drives) as host:
        task = host.send_periodic(beat, 0.01)
        failure, _, _ = call("sdo", "set", "x", "0x6065", "2mm", *where)
        assert "another host is on it" in str(failure)
        failure, out, _ = call("sdo", "get", "x", "0x6065", *where)
        assert failure == 0
        assert "= 1 mm" in out
        assert call("sdo", "set", "x", "0x6065", "2mm", "--yes", *where)[0] == 0
        task.stop()
