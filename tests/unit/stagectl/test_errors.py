"""Which failure to write is the fault of the path."""

from __future__ import annotations

import errno
import os

import pytest

from stagectl.errors import StagectlError, UnusableInput, failure_to_write


@pytest.mark.parametrize(
    ("number", "code"),
    [
        (errno.EACCES, 2),
        (errno.EROFS, 2),
        (errno.ENOENT, 2),
        (errno.ENOTDIR, 2),
        (errno.ENOSPC, 1),
        (errno.EIO, 1),
    ],
)
def test_another_path_helps_or_not(number: int, code: int) -> None:
    failure = failure_to_write("/x/y: cannot create", OSError(number, os.strerror(number)))
    assert failure.exit_code == code
    assert isinstance(failure, UnusableInput if code == 2 else StagectlError)
    assert str(failure) == f"/x/y: cannot create: {os.strerror(number)}"
