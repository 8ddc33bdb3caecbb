"""Weaknesses that comparable consoles have had, each by name."""

import hmac
import os
import re
import threading
import time

import pytest
from starlette.routing import Mount, Route, WebSocketRoute

from stagectl.console.access import Access
from stagectl.console.archive import report_policy
from stagectl.console.folder import NoSuchFile, open_inside
from stagectl.console.gate import POLICY
from tests.unit.stagectl.console.live_console import TOKEN, page


def test_api_key_is_compared_in_constant_time(monkeypatch):
    compared, compare = [], hmac.compare_digest
    monkeypatch.setattr(
        hmac, "compare_digest", lambda a, b: compared.append((len(a), len(b))) or compare(a, b)
    )
    access = Access(TOKEN)
    assert access.log_in("x") is None
    assert access.log_in(TOKEN + "x") is None
    cookie = access.log_in(TOKEN)
    assert access.session(cookie) is not None
    assert len(compared) == 4
    assert all(a == b for a, b in compared)  # digests: what is compared has always one length


def test_stored_script_in_a_report_does_not_run(live):
    status, headers, body = live.get("/files/run-1/report.html")
    policy = headers["content-security-policy"]
    assert status == 200
    assert b"alert(1)" in body
    assert policy == report_policy()
    assert "unsafe-inline" not in re.search("script-src[^;]*", policy)[0]
    sandbox = re.search("sandbox([^;]*)", policy)[1]
    assert "allow-same-origin" not in sandbox  # what it runs cannot ask this console for anything
    assert "connect-src" not in policy
    assert "default-src 'none'" in policy


def test_stored_script_in_names_is_text_to_the_page(live, folders):
    run = folders / "data" / "<img src=x onerror=alert(1)>"
    run.mkdir()
    (run / "summary.json").write_text("{}")
    _, headers, body = live.get("/api/runs")
    assert headers["content-type"] == "application/json"
    assert headers["x-content-type-options"] == "nosniff"
    assert b"<img src=x" in body
    run.joinpath("summary.json").unlink()
    run.rmdir()
    assert "script-src 'self';" in POLICY
    assert "unsafe" not in POLICY


def _paths(routes, before=""):
    for route in routes:
        if isinstance(route, Mount):
            yield before + route.path + "/x.js", "GET"
        elif isinstance(route, WebSocketRoute):
            yield before + route.path, "GET"
        elif isinstance(route, Route):
            path = re.sub(r"{\w+}", "run-1", before + route.path)
            yield from ((path, method) for method in route.methods)


def test_no_route_is_without_authentication(stranger):
    open_to_all = {"/", "/static/plots/x.js", "/static/x.js", "/api/login"}
    closed = set()
    for path, method in _paths(stranger.console.gate.app.routes):
        headers = {"Origin": stranger.origin}
        body = b"{}" if method == "POST" else None
        if body:
            headers["Content-Type"] = "application/json"
        status, _, _ = stranger.request(method, path, body, headers)
        if path not in open_to_all:
            assert status == 401, (method, path)
            closed.add(path)
    assert len(closed) > 15


def test_no_key_in_the_first_frame_of_a_socket(stranger):
    status, _, _ = stranger.request(
        "GET", "/ws", None,
        {"Origin": stranger.origin, "Connection": "Upgrade", "Upgrade": "websocket",
         "Sec-WebSocket-Version": "13", "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ=="},
    )  # fmt: skip
    assert status == 401  # before a frame could come


@pytest.mark.parametrize(
    "name",
    ["..\\secret.json", "run-1\\..\\..\\secret.json", "C:\\x.json", "\\\\host\\x.json", "..", ".",
     "", "a/b.json", "/etc/passwd", "a\0.json", "a\n.json", ".hidden.json", "link.json"],
)  # fmt: skip
def test_no_traversal_by_backslash_or_otherwise(folders, name):
    with pytest.raises(NoSuchFile):
        open_inside(folders / "data", "run-1", name)
    with pytest.raises(NoSuchFile):
        open_inside(folders / "data", name, "secret.json")


def test_a_file_with_an_unusual_name_is_found(folders):
    path = folders / "data" / "run-1" / "Prüfling 7 (a).json"
    path.write_text("{}")
    with open_inside(folders / "data", "run-1", path.name) as file:
        assert file.read() == b"{}"
    path.unlink()


def test_pages_that_come_and_go_leave_nothing(live):
    def used():
        return len(os.listdir("/proc/self/fd")), threading.active_count()  # noqa: PTH208

    def visit():
        with page(live) as opened:
            opened.send('{"samples": true}')
            opened.send('{"id": 1, "ask": {"op": "take", "force": true}}')
            opened.recv(60)

    visit()
    before = used()
    for _ in range(30):
        visit()
    deadline = time.monotonic() + 60
    while live.console.sessions or used()[0] > before[0] + 3 or used()[1] > before[1] + 3:
        assert time.monotonic() < deadline, (live.console.sessions, used(), before)
        time.sleep(0.1)


def test_no_address_is_trusted(live):
    """A rebound page comes from loopback, with a name of its own and whatever headers."""
    forwarded = {"X-Forwarded-For": "127.0.0.1", "X-Forwarded-Host": f"127.0.0.1:{live.port}"}
    status, _, _ = live.get("/api/runs", Host=f"attacker.example:{live.port}", **forwarded)
    assert status == 421


def test_json_is_not_accepted_as_text(live, fake):
    status, _, _ = live.post("/api/stop", {}, **{"Content-Type": "text/plain"})
    assert status == 415
    assert not fake.asked("stop")
