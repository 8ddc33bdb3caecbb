"""CAN interfaces of this machine."""

from stagectl.doctor import buses


def test_interfaces_are_those_of_the_can_kind(tmp_path, monkeypatch):
    for name, kind, state in (("can0", 280, "up"), ("can1", 280, "down"), ("eth0", 1, "up")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "type").write_text(f"{kind}\n")
        (tmp_path / name / "operstate").write_text(f"{state}\n")
    monkeypatch.setattr(buses, "NETWORK", tmp_path)
    assert buses.can_interfaces() == {"can0": "up", "can1": "down"}
