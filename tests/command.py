"""`stagectl` in this process, as a shell sees it: exit status and what it says."""

from __future__ import annotations

import io
import os
import subprocess
import sys
from pathlib import Path

import pytest

from stagectl.cli import main
from tests.signals import as_in_a_terminal


def stagectl(
    *arguments: str | os.PathLike[str], cwd: Path | None = None
) -> subprocess.CompletedProcess[str]:
    """Call the command; what only a process of its own shows is not seen here."""
    said = [io.TextIOWrapper(io.BytesIO(), "utf-8", write_through=True) for _ in range(2)]
    words = ["stagectl", *map(str, arguments)]
    code: str | int | None = 0
    with as_in_a_terminal(), pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", words)
        patch.setattr(sys, "stdout", said[0])
        patch.setattr(sys, "stderr", said[1])
        if cwd is not None:
            patch.chdir(cwd)
        try:
            main()
        except SystemExit as ended:
            code = ended.code
    assert isinstance(code, int)
    out, err = (stream.buffer.getvalue().decode() for stream in said)  # type: ignore[attr-defined]
    return subprocess.CompletedProcess(words, code, out, err)
