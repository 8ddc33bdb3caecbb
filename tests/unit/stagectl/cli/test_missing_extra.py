"""A command whose extra is not installed says so in one line, and ends with exit code 2."""

import sys

import pytest
from click.testing import CliRunner

from stagectl.cli import cli
from stagectl.errors import UnusableInput


@pytest.mark.parametrize(
    ("command", "package", "extra"),
    [
        (("fleet", "diagnose", ".", "--out", "results"), "dask", "fleet"),
        (("fleet", "summary", "results"), "pyarrow", "fleet"),
        (("console", "--simulate"), "uvicorn", "console"),
    ],
)
def test_a_missing_extra_is_named_with_the_command_that_installs_it(
    command, package, extra, monkeypatch, tmp_path
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, package, None)  # as if it were not installed
    result = CliRunner().invoke(cli, command)
    assert isinstance(result.exception, UnusableInput), result.output
    assert result.exception.exit_code == 2
    assert str(result.exception).endswith(f"{package}: pip install 'stagectl[{extra}]'")
    assert list(tmp_path.iterdir()) == []
