"""Boot-up and identity of a node."""

import pytest

from drivers.errors import ConfigurationError, NodeError

X, Y = 0, 1


@pytest.mark.parametrize(
    ("key", "value", "error", "text"),
    [
        ((0x1018, 1), 0x22, NodeError, r"^axis x: 0x1018:01 vendor id: is 0x00000022, the EDS"),
        ((0x1018, 2), 0x99, NodeError, r"^axis x: 0x1018:02 product code: is 0x00000099"),
        ((0x1018, 3), 0x30000, NodeError, r"0x1018:03 .*major revision is 3, the EDS describes 1"),
        ((0x1000, 0), 0x191, NodeError, r"^axis x: 0x1000:00 device type: is profile 401"),
        ((0x6076, 0), 39000, ConfigurationError, r"0x6076:00 .*says 39 N, the settings 40 N"),
        ((0x6092, 1), 1000, ConfigurationError, r"0x6092:01 feed: factor group: .* 0.001 encoder"),
        ((0x6502, 0), 0x20, ConfigurationError, r"0x6502:00 .*cyclic synchronous position"),
    ],
)
def test_a_device_other_than_the_expected_one_is_refused(opened, scripted, key, value, error, text):
    scripted.drives[X].objects[key] = value
    with opened, pytest.raises(error, match=text):
        opened.boot()
