"""Which faults may be acknowledged without anybody looking at the machine."""

import pytest

from drivers import AxisFault
from stagectl.run.retries import is_recoverable


@pytest.mark.parametrize(
    ("code", "recoverable"),
    [
        (None, True),  # a drive that fell silent
        (0x8130, True),  # heartbeat lost
        (0x8611, True),  # following error
        (0x8612, False),  # over-travel
        (0x2310, False),  # current
        (0x3210, False),  # voltage
        (0x4210, False),  # temperature
        (0x5441, False),  # hardware
        (0x7300, False),  # sensor
    ],
)
def test_the_error_code_decides(code, recoverable):
    assert is_recoverable(AxisFault("fault", axis="x", code=code)) is recoverable
