"""`stagectl console` where it cannot start: one line, exit code 2."""

import fcntl

import pytest

from tests.command import stagectl


@pytest.fixture(autouse=True)
def runtime(tmp_path, monkeypatch):
    monkeypatch.setenv("STAGECTL_RUNTIME", str(tmp_path))
    return tmp_path


def refusal(*arguments):
    done = stagectl("console", "--no-browser", *arguments)
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    return done.stderr


def test_no_server_and_none_to_be_started():
    assert "--simulate or --bus" in refusal()
    assert "'bench'" in refusal("--server", "bench")


def test_several_servers(runtime):
    locks = [(runtime / f"{name}.lock").open("w") for name in ("a", "b")]
    for lock in locks:
        fcntl.flock(lock, fcntl.LOCK_EX)
    assert "a, b" in refusal()
    for lock in locks:
        lock.close()


def test_two_buses():
    assert "--simulate" in refusal("--simulate", "--bus", "socketcan:can0")


@pytest.mark.parametrize("host", ["0.0.0.0", "192.0.2.1", "::"])  # noqa: S104
def test_the_network_needs_a_token(host):
    assert "--token-file" in refusal("--simulate", "--host", host)


@pytest.mark.parametrize("text", ["", "tiny!", "a token of many characters\n", "ü" * 20])
def test_a_bad_token(runtime, text):
    (runtime / "token").write_text(text)
    said = refusal("--simulate", "--token-file", runtime / "token")
    assert str(runtime / "token") in said
    assert not text.strip() or text.strip() not in said


def test_a_missing_token():
    assert "no-such-file" in refusal("--simulate", "--token-file", "no-such-file")


@pytest.mark.parametrize(
    "origin",
    ["stage.example", "https://stage.example/", "ftp://stage.example", "https://a@stage.example",
     "https://Stage.example", "https://"],
)  # fmt: skip
def test_a_bad_origin(origin):
    assert origin in refusal("--simulate", "--port", "0", "--origin", origin)
