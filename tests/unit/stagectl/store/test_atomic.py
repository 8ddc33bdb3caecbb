"""Whole or not at all; and a device stays a device."""

import os
import threading

import pytest

from stagectl.errors import StagectlError
from stagectl.store import write_atomically


def test_a_file_is_replaced_and_nothing_is_left_beside_it(tmp_path):
    path = tmp_path / "page.html"
    path.write_text("old")
    write_atomically(path, "µ", "page", durable=True)
    assert path.read_bytes() == "µ".encode()
    assert list(tmp_path.iterdir()) == [path]


def test_a_failed_write_names_the_file_and_keeps_the_old_one(tmp_path):
    with pytest.raises(StagectlError, match="Is a directory"):
        write_atomically(tmp_path, "", "page")
    with pytest.raises(StagectlError, match=r"none/page: cannot write the page: No such file"):
        write_atomically(tmp_path / "none" / "page", "", "page")
    (tmp_path / "page").write_text("old")
    (tmp_path / "page.part").mkdir()
    with pytest.raises(StagectlError, match="Is a directory"):
        write_atomically(tmp_path / "page", "new", "page")
    assert (tmp_path / "page").read_text() == "old"


def test_a_link_beside_it_is_replaced_and_never_followed(tmp_path):
    precious, path = tmp_path / "precious", tmp_path / "page"
    precious.write_text("mine")
    (tmp_path / "page.part").symlink_to(precious)
    write_atomically(path, "new", "page")
    assert (precious.read_text(), path.read_text()) == ("mine", "new")
    assert not path.is_symlink()


def test_a_pipe_is_written_to_and_stays(tmp_path):
    path, seen = tmp_path / "pipe", []
    os.mkfifo(path)
    reader = threading.Thread(target=lambda: seen.append(path.read_text()))
    reader.start()
    write_atomically(path, "text", "page")
    reader.join(60)
    assert seen == ["text"]
    assert path.is_fifo()
