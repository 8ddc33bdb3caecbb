"""A stream that nobody reads any more."""

import os

import pytest

from stagectl.cli.plain_terminal import PlainConsole


def test_a_broken_pipe_takes_no_other_stream_along(capfd):
    read, write = os.pipe()
    os.close(read)
    with os.fdopen(write, "w") as broken:
        console = PlainConsole(file=broken)
        with pytest.raises(SystemExit):
            console.print("nobody reads this")
        console.print("nor this")
    print("standard output")  # noqa: T201
    assert capfd.readouterr().out == "standard output\n"
