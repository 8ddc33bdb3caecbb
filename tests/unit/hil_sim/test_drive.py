"""The virtual drive as a node: its counter, SYNC, faults that are injected."""

import pytest


def test_the_counter_starts_at_zero_wherever_the_axis_stands(host, plant):
    assert plant.actual[0] == 2.5e-3
    assert host.read_object(1, 0x6064, 0, "i") == 0


def test_bit_31_of_the_sync_cob_id_has_no_meaning(host):
    host.write(1, 0x1005, 0, "I", 0x80000080)
    assert host.read_object(1, 0x1005, 0, "I") == 0x80000080
    host.nmt(1)
    host.send(0x080)
    assert len(host.take(0x181)) == 1


@pytest.mark.parametrize("code", [0, -1, 0x10000])
def test_an_invalid_error_code_is_refused(stage, host, code):
    with pytest.raises(ValueError, match="error code"):
        stage.drives[0].inject_fault(code)


def test_the_sync_counter(host):
    assert host.refusal(lambda: host.write(1, 0x1019, 0, "B", 1)) == 0x06090030
    assert host.refusal(lambda: host.write(1, 0x1019, 0, "B", 241)) == 0x06090031
    host.write(1, 0x1006, 0, "I", 1000)
    assert host.refusal(lambda: host.write(1, 0x1019, 0, "B", 10)) == 0x08000022
    host.write(1, 0x1006, 0, "I", 0)
    host.write(1, 0x1019, 0, "B", 10)
    host.nmt(1)
    host.send(0x080, b"\x01")
    assert len(host.take(0x181)) == 1
    for _ in range(3):
        host.send(0x080)
    assert host.take(0x181) == []
    assert host.emergencies() == [(0x8240, 0x11)]  # once
    host.nmt(130)
    host.wait(30)
    host.map_for_csp()
    host.nmt(1)
    host.send(0x080)
    assert len(host.take(0x181)) == 1
