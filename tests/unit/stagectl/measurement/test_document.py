"""The file of a measurement, and when it says nothing of a stage."""

import json

import pytest

from stagectl.errors import UnusableInput
from stagectl.measurement import load_measurement, parse_measurement, response_path
from stagectl.measurement.document import Identity
from tests.unit.stagectl.machines import with_axes


def entry():
    one = {"at": [2.0, 4.0], "real": [1e-6, 1e-6], "imaginary": [0.0, 1e-7], "sigma": [0.0, 0.0]}
    state = {"offset": one, "demand": one, "distortion": 0.0}
    drive = {"vendor": 1, "product": 2, "revision": 3, "serial": None}
    settings = {
        "bus.sync_period": 1e-3, "drive.pid.kp": 341000.0, "drive.pid.ki": 16070000.0,
        "drive.pid.kd": 2714.0, "drive.pid.derivative_time": 8.842e-4,
        "drive.rated_force": 40.0, "drive.position_unit": 1e-9,
    }  # fmt: skip
    return {"drive": drive, "settings": settings, "rest": state, "sliding": state}


def text(change=lambda _: None):
    whole = {
        "format": "stagectl-response", "version": 1, "measured": "2026-01-01T00:00:00+00:00",
        "machine": "wafer-xy", "axes": {"x": entry()},
    }  # fmt: skip
    whole = json.loads(json.dumps(whole))  # nothing in it is shared
    change(whole)
    return json.dumps(whole)


def test_a_file_is_read():
    found = parse_measurement(text(), "m.json")
    assert found.axes["x"].identity == Identity(vendor=1, product=2, revision=3, serial=None)
    assert found.axes["x"].response.rest.offset[1] == 1e-6 + 1e-7j
    assert parse_measurement(found.as_text(), "m").as_text() == found.as_text()


@pytest.mark.parametrize(
    ("path", "value", "reason"),
    [
        ("version", 2, "version"),
        ("measured", "yesterday", "measured: Value error, Invalid isoformat string"),
        ("measured", "2026-01-01T00:00:00", "measured: Value error, has no time zone"),
        ("axes", {}, "axes"),
        ("axes x rest offset real", [1e-6], "rest.offset: at, real, imaginary and"),
        ("axes x sliding demand at", [4.0, 2.0], "sliding.demand: frequencies do"),
        ("axes x sliding offset at", [2.0, 5.0], "the frequencies at rest and while"),
        ("axes x rest offset real", [0.0, 1.0], "rest.offset: a response of 0"),
        ("axes x rest distortion", -1.0, "axes.x.rest.distortion"),
        ("axes x rest offset real", [float("nan"), 1.0], "axes.x.rest.offset.real"),
        ("axes x drive colour", "red", "axes.x.drive.colour"),
    ],
)
def test_a_bad_file_is_one_line_with_file_key_and_reason(path, value, reason):
    def change(whole):
        *above, last = path.split()
        for key in above:
            whole = whole[key]
        whole[last] = value

    with pytest.raises(UnusableInput) as refused:
        parse_measurement(text(change), "m.json")
    message = str(refused.value)
    assert message.startswith("m.json: ")
    assert reason in message
    assert "\n" not in message


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b"\xff\xfe", b'{"format": "other"}'])
def test_what_is_no_measurement(tmp_path, content):
    path = tmp_path / "a.json"
    path.write_bytes(content)
    with pytest.raises(UnusableInput, match=str(path)):
        load_measurement(path)
    with pytest.raises(UnusableInput, match="No such file"):
        load_measurement(tmp_path / "none.json")


def test_it_is_void_after_a_change(machine):
    found = parse_measurement(text(), "m.json")
    assert found.objection(machine, "x") is None
    bus = machine.bus.model_copy(update={"sync_period": 2e-3})
    slower = machine.model_copy(update={"bus": bus})
    assert "bus.sync_period is 0.002" in found.objection(slower, "x")
    pid = machine.axes["x"].drive.pid.model_copy(update={"kp": 300e3})
    other = with_axes(machine, x={"drive": {"pid": pid}})
    said = found.objection(other, "x")
    assert said == "drive.pid.kp is 300000; it was measured with 341000"
    assert found.objection(other, "x", simulated=True) is None
    assert found.objection(machine, "y") == "not in m.json"


def test_a_virtual_stage_or_another_one_says_nothing_of_a_real_one(machine):
    found = parse_measurement(text(lambda whole: whole.update(measured=None)), "m.json")
    assert "virtual stage" in found.objection(machine, "x")
    found = parse_measurement(text(lambda whole: whole.update(machine="other")), "m.json")
    assert found.objection(machine, "x") == "m.json is of other, not of wafer-xy"
    assert found.objection(machine, "x", simulated=True) is None


def test_it_lies_beside_the_machine_file(machine, tmp_path):
    assert response_path(machine, tmp_path / "a.yaml") == tmp_path / "a.response.json"
    assert str(response_path(machine, None)) == "wafer-xy.response.json"
