"""Compiled kernels do not outlive the code they were made from."""

import os
import time
from pathlib import Path

import pytest

from stagectl import kernel_cache


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(kernel_cache, "_ROOT", tmp_path)
    folder = tmp_path / "estimation"
    (folder / "__pycache__").mkdir(parents=True)
    (folder / "gms.py").write_text("")
    for name in ("window.f-1.py311.nbi", "window.f-1.py311.1.nbc", "window.cpython-311.pyc"):
        (folder / "__pycache__" / name).write_text("")
    return folder


def test_kernels_older_than_any_source_are_deleted(package):
    later = time.time() + 10
    os.utime(package / "gms.py", (later, later))
    assert kernel_cache.drop_stale() == 2
    assert [p.name for p in (package / "__pycache__").iterdir()] == ["window.cpython-311.pyc"]
    assert kernel_cache.drop_stale() == 0


def test_fresh_kernels_are_kept(package):
    earlier = time.time() - 10
    os.utime(package / "gms.py", (earlier, earlier))
    assert kernel_cache.drop_stale() == 0
    assert len(list((package / "__pycache__").iterdir())) == 3


def test_kernels_with_the_code_of_another_package_are_deleted_with_it(package, tmp_path):
    for name in ("hil_sim", "sim2real"):
        (tmp_path / name / "__pycache__").mkdir(parents=True)
        (tmp_path / name / "code.py").write_text("")
        kept = tmp_path / name / "__pycache__" / "code.f-1.py311.nbi"
        kept.write_text("")
        os.utime(tmp_path / name / "code.py", (1, 1))
    os.utime(package / "gms.py", (1, 1))
    assert kernel_cache.drop_stale() == 0
    later = time.time() + 10
    os.utime(tmp_path / "hil_sim" / "code.py", (later, later))
    assert kernel_cache.drop_stale() == 2
    assert not kept.exists()


def test_a_kernel_that_another_process_has_just_deleted_is_skipped(package):
    (package / "__pycache__" / "gone.f-1.py311.nbi").symlink_to("nothing")
    earlier = time.time() - 10
    os.utime(package / "gms.py", (earlier, earlier))
    assert kernel_cache.drop_stale() == 0
