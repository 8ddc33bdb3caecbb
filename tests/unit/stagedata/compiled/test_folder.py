"""Kernels are code: what others own or can write is refused, and no link is followed."""

from __future__ import annotations

import logging
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import stagedata
from stagedata.compiled.folder import KernelFolder

NAME = "module.kernel-0-1.kernel"


@pytest.fixture
def folder(tmp_path):
    made = KernelFolder(tmp_path / "kernels")
    made.write(NAME, b"code")
    return made


def test_what_is_kept_is_for_this_user_only(folder):
    old = os.umask(0)
    try:
        other = KernelFolder(folder.path.parent / "others" / "kernels")
        other.write(NAME, b"code")
        lock = other.lock("module.lock")
    finally:
        os.umask(old)
    assert lock is not None
    lock.close()
    assert other.path.stat().st_mode & 0o777 == 0o700
    assert {path.stat().st_mode & 0o777 for path in other.path.iterdir()} == {0o600}
    assert other.read(NAME) == b"code"


@pytest.mark.parametrize("mode", [0o777, 0o1777, 0o775])
def test_a_folder_that_others_can_write_is_refused_with_the_reason(folder, mode, caplog):
    folder.path.chmod(mode)
    assert folder.read(NAME) is None
    assert folder.lock("module.lock") is None
    with pytest.raises(OSError, match="others can write it"):
        folder.write(NAME, b"other")
    assert f"kernels: others can write it (mode {mode:04o})" in caplog.text
    assert folder.problem() in caplog.text
    folder.path.chmod(0o755)
    assert folder.read(NAME) == b"code"


def test_a_file_that_others_can_write_is_refused_and_made_anew(folder, caplog):
    (folder.path / NAME).chmod(0o666)
    assert folder.read(NAME) is None
    assert f"{NAME}: others can write it (mode 0666)" in caplog.text
    folder.write(NAME, b"new")
    assert folder.read(NAME) == b"new"


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give files away")
def test_what_belongs_to_another_user_is_refused(folder, caplog):
    os.chown(folder.path / NAME, 12345, -1)
    assert folder.read(NAME) is None
    assert f"{NAME}: belongs to another user (uid 12345)" in caplog.text
    os.chown(folder.path, 12345, -1)
    assert folder.problem() == f"{folder.path}: belongs to another user (uid 12345)"


def test_no_link_is_followed(folder, tmp_path):
    precious = tmp_path / "precious"
    precious.write_text("mine")
    (folder.path / "module.lock").symlink_to(precious)
    assert folder.lock("module.lock") is None
    part = folder.path / f"{NAME}.{os.getpid()}"
    part.symlink_to(precious)
    folder.write(NAME, b"new")
    assert precious.read_text() == "mine"
    linked = KernelFolder(tmp_path / "link")
    linked.path.symlink_to(folder.path)
    assert linked.problem() == f"{linked.path}: is a link"
    assert linked.read(NAME) is None


def test_a_pipe_in_place_of_a_file_does_not_hang(folder):
    (folder.path / NAME).unlink()
    os.mkfifo(folder.path / NAME, 0o600)
    assert folder.read(NAME) is None


def test_a_reason_is_told_once(folder, caplog):
    folder.path.chmod(0o777)
    with caplog.at_level(logging.WARNING):
        folder.read(NAME)
        folder.read("other")
    assert len(caplog.records) == 1


def test_without_a_home_kernels_are_kept_nowhere(tmp_path):
    """As in a container with a user that has no entry in the list of users."""
    site = tmp_path / "site"
    package = site / "stagedata"
    ignored = shutil.ignore_patterns("__pycache__", "shipped")
    shutil.copytree(Path(stagedata.__file__).parent, package, ignore=ignored)
    (package / "compiled" / "__pycache__").write_text("in the way")
    program = "from stagedata.compiled import kernel_folder; print(kernel_folder().problem())"
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True,
        cwd=site, env={"XDG_CACHE_HOME": "~nobody-of-this-name/cache"},
    )  # fmt: skip
    assert done.stdout == "no home folder; NUMBA_CACHE_DIR names another\n"
