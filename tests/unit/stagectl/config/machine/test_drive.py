"""Drives of a machine file."""

import pytest

from stagectl.config import load_machine, parse_machine
from stagectl.errors import ConfigError

GOOD = load_machine().text


def test_a_count_of_force_is_a_thousandth_of_the_rated_force() -> None:
    drive = load_machine().axes["x"].drive
    assert drive.force_unit * 1000 == drive.rated_force


@pytest.mark.parametrize(
    ("key", "value", "allowed"),
    [("quick_stop", 4, "0, 1, 2, 3, 5, 6, 7 or 8"), ("abort_connection", 0, "1, 2 or 3")],
)
def test_an_option_code_that_leaves_the_stop_open_is_refused(key, value, allowed) -> None:
    """4 stops a frequency converter at its voltage limit; 0x6007 = 0 would be no stop at all."""
    text = GOOD.replace("    drive:\n", f"    drive:\n      options: {{{key}: {value}}}\n", 1)
    assert text != GOOD
    with pytest.raises(ConfigError) as refused:
        parse_machine(text, "m")
    assert f"axes.x.drive.options.{key}: must be {allowed}, is {value}" in str(refused.value)
