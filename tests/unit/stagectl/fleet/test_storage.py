"""Recordings are found and results kept in folders and in an object store alike."""

import hashlib
import os

import pytest

from stagectl.errors import UnusableInput
from stagectl.fleet.storage import Folder, content_of, find_recordings, local_copy


@pytest.fixture(scope="module")
def bucket():
    """An object store of this process; the address of a bucket in it."""
    import s3fs
    from moto.server import ThreadedMotoServer

    given = {
        "AWS_ACCESS_KEY_ID": "test",
        "AWS_SECRET_ACCESS_KEY": "test",
        "AWS_REGION": "eu-west-1",
    }
    server = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    with pytest.MonkeyPatch.context() as patch:
        for name, value in (given | {"AWS_ENDPOINT_URL": f"http://{host}:{port}"}).items():
            patch.setenv(name, value)
        s3fs.S3FileSystem.clear_instance_cache()  # one may know another test's server
        s3fs.S3FileSystem().mkdir("another")  # servers of one process have the same buckets
        yield "s3://another"
    s3fs.S3FileSystem.clear_instance_cache()
    server.stop()


def put(place, name, content=b"content"):
    Folder(place).write(name, content)


@pytest.fixture(params=["folder", "bucket"])
def place(request, tmp_path):
    """The address of an empty folder."""
    if request.param == "folder":
        return str(tmp_path)
    return f"{request.getfixturevalue('bucket')}/{tmp_path.name}"


def test_folders_globs_and_files_are_found_once(place):
    for name in ("a/1.h5", "a/deep/2.h5", "b/3.h5", "b/report.html"):
        put(place, name)
    urls = [f"{place}/{name}" for name in ("a/1.h5", "a/deep/2.h5", "b/3.h5")]
    assert [of.url for of in find_recordings([place])] == urls
    assert [of.url for of in find_recordings([f"{place}/*/*.h5"])] == [urls[0], urls[2]]
    assert [of.url for of in find_recordings([urls[2], f"{place}/?", urls[2]])] == urls


def test_a_stamp_changes_with_the_content(place):
    put(place, "1.h5")
    (before,) = find_recordings([f"{place}/1.h5"])
    assert find_recordings([f"{place}/1.h5"]) == [before]
    put(place, "1.h5", b"others")
    assert find_recordings([f"{place}/1.h5"])[0].stamp != before.stamp


def test_a_folder_of_results_keeps_files_whole(place):
    folder = Folder(place)
    assert not folder.has("results/ab/1.parquet")
    assert folder.names("results") == set()
    folder.write("results/ab/1.parquet", b"one")
    folder.write("results/cd/2.parquet", b"two")
    folder.write("results/cd/3.parquet.part", b"cut")
    assert folder.has("results/ab/1.parquet")
    assert folder.names("results") == {"results/ab/1.parquet", "results/cd/2.parquet"}
    names = ["results/ab/1.parquet", "results/none.parquet"]
    assert folder.read(names) == {"results/ab/1.parquet": b"one"}
    assert folder.read([]) == {}


def test_a_worker_reads_a_copy_only_of_what_is_elsewhere(place):
    put(place, "1.h5", b"what is in it")
    with local_copy(f"{place}/1.h5") as path:
        assert path.read_bytes() == b"what is in it"
        assert content_of(path) == hashlib.sha256(b"what is in it").hexdigest()
    assert path.exists() == (not place.startswith("s3:"))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("nowhere.h5", "no such file"),
        ("s4://bucket/1.h5", "s4"),
        (os.devnull + "/x/*.h5", "no such file"),
    ],
)
def test_what_is_not_there_is_one_line_that_names_it(text, words):
    with pytest.raises(UnusableInput) as raised:
        find_recordings([text])
    line = str(raised.value)
    assert line.startswith(text)
    assert words in line
    assert "\n" not in line
