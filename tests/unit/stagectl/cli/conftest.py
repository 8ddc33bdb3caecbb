"""Commands called in this process."""

import pytest
from click.testing import CliRunner

from stagectl.cli import cli


@pytest.fixture
def call():
    """The command in this process: (exit code or exception, standard output)."""

    def go(*arguments):
        done = CliRunner().invoke(cli, [*map(str, arguments)], env={"COLUMNS": "160"})
        failure = done.exception if done.exit_code == 1 and done.exception else done.exit_code
        return failure, done.stdout, done.stderr

    return go
