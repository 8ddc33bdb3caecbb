"""Exit codes as docs/formats/run.md has them, messages of one line, failures to write."""

import errno
import os
from pathlib import Path

import pytest

from stagectl.errors import (
    Aborted,
    ConfigError,
    LimitsMissed,
    RunFault,
    StagectlError,
    UnusableInput,
    failure_to_write,
)

DOCUMENTED = {
    "unusable input": {ConfigError, UnusableInput},
    "fault": {RunFault},
    "completed, but a site misses": {LimitsMissed},
    "stopped by the operator": {Aborted},
    "anything else": {StagectlError},
}


def test_exit_codes_are_those_of_the_contract():
    text = Path(__file__).parents[3].joinpath("docs/formats/run.md").read_text()
    (line,) = [x for x in text.splitlines() if x.startswith("- Exit code: 0 completed;")]
    for words, classes in DOCUMENTED.items():
        for error in classes:
            assert f" {error.exit_code} {words}" in line, error


@pytest.mark.parametrize("problems", [["a.yaml:1: x: bad", "a.yaml:2: y: bad"], "a.yaml:1: x: bad"])
def test_a_config_error_has_one_line_per_problem(problems):
    error = ConfigError(problems)
    assert str(error).splitlines() == list(error.problems)
    assert len(error.problems) == (1 if isinstance(problems, str) else 2)


ELSEWHERE = (errno.EACCES, errno.EROFS, errno.ENOENT, errno.ENOTDIR)


@pytest.mark.parametrize(
    ("number", "code"), [*((number, 2) for number in ELSEWHERE), (errno.ENOSPC, 1), (errno.EIO, 1)]
)
def test_another_path_helps_or_not(number, code):
    failure = failure_to_write("/x/y: cannot create", OSError(number, os.strerror(number)))
    assert failure.exit_code == code
    assert isinstance(failure, UnusableInput if code == 2 else StagectlError)
    assert str(failure) == f"/x/y: cannot create: {os.strerror(number)}"
