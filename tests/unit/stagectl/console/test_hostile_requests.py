"""A table of hostile requests: each is refused with the right status, and the stage hears nothing.

The last test of each part looks at what the stage server was asked for.
"""

import json

import pytest
import websockets.exceptions

from stagectl.console.gate import LARGEST
from tests.unit.stagectl.console.live_console import answer, page

DROP = object()


def request(live, method, path, body=None, /, **changes):
    """The bytes of a request that would be answered but for `changes` of its headers."""
    headers = {"Host": f"127.0.0.1:{live.port}", "Cookie": live.cookie}
    if method == "POST":
        body = b"{}" if body is None else body
        headers |= {"Origin": live.origin, "Content-Type": "application/json"}
        headers |= {"Content-Length": str(len(body))}
    headers |= {name.replace("_", "-"): value for name, value in changes.items()}
    lines = [f"{method} {path} HTTP/1.1"]
    for name, value in headers.items():
        values = value if isinstance(value, list) else [value]
        lines += [f"{name}: {one}" for one in values if one is not DROP]
    return "\r\n".join(lines).encode("latin-1") + b"\r\nConnection: close\r\n\r\n" + (body or b"")


def get(path, **changes):
    return lambda live: request(live, "GET", path, **changes)


def post(path, body=None, **changes):
    return lambda live: request(live, "POST", path, body, **changes)


def socket(path="/ws?ticket={ticket}", **changes):
    """A handshake with a valid ticket but for `changes`."""

    def made(live):
        upgrade = {
            "Origin": live.origin, "Upgrade": "websocket", "Sec-WebSocket-Version": "13",
            "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
        }  # fmt: skip
        where = path.format(ticket=live.ticket() if "{ticket}" in path else "")
        data = request(live, "GET", where, **(upgrade | changes))
        return data.replace(b"Connection: close", b"Connection: Upgrade")

    return made


def of_origin(text):
    return lambda live: request(live, "POST", "/api/stop", Origin=text.format(port=live.port))


NAMED = b'{"name": "Anna"}'
HTTP = {
    # Host: a rebound page names its own
    "host-foreign": (421, get("/", Host="attacker.example")),
    "host-foreign-with-port": (421, lambda v: request(v, "GET", "/", Host=f"a.example:{v.port}")),
    "host-without-port": (421, get("/", Host="127.0.0.1")),
    "host-other-port": (421, get("/", Host="127.0.0.1:1")),
    "host-empty": (421, get("/", Host="")),
    "host-absent": (400, get("/", Host=DROP)),
    "host-twice": (400, lambda v: request(v, "GET", "/", Host=[f"127.0.0.1:{v.port}"] * 2)),
    "host-with-user": (421, lambda v: request(v, "GET", "/", Host=f"a@127.0.0.1:{v.port}")),
    "host-in-decimal": (421, lambda v: request(v, "GET", "/", Host=f"2130706433:{v.port}")),
    "host-zero": (421, lambda v: request(v, "GET", "/", Host=f"0.0.0.0:{v.port}")),
    "host-trailing-dot": (421, lambda v: request(v, "GET", "/", Host=f"localhost.:{v.port}")),
    "host-forwarded": (421, get("/", Host="a.example", X_Forwarded_Host="127.0.0.1")),
    "address-forwarded": (401, get("/api/runs", Cookie=DROP, X_Forwarded_For="127.0.0.1")),
    "address-real-ip": (401, get("/api/runs", Cookie=DROP, X_Real_IP="127.0.0.1")),
    # Origin and Fetch metadata: another page's request
    "origin-absent": (403, post("/api/stop", Origin=DROP)),
    "origin-foreign": (403, of_origin("https://attacker.example")),
    "origin-null": (403, of_origin("null")),
    "origin-empty": (403, of_origin("")),
    "origin-other-scheme": (403, of_origin("https://127.0.0.1:{port}")),
    "origin-other-port": (403, of_origin("http://127.0.0.1:1")),
    "origin-as-prefix": (403, of_origin("http://127.0.0.1:{port}.attacker.example")),
    "origin-as-suffix": (403, of_origin("http://attacker.example/http://127.0.0.1:{port}")),
    "origin-upper-case": (403, of_origin("HTTP://127.0.0.1:{port}")),
    "origin-twice": (400, lambda v: request(v, "POST", "/api/stop", Origin=[v.origin] * 2)),
    "origin-foreign-get": (403, get("/api/runs", Origin="https://attacker.example")),
    "fetch-cross-site": (403, get("/api/runs", Sec_Fetch_Site="cross-site")),
    "fetch-same-site": (403, post("/api/stop", Sec_Fetch_Site="same-site")),
    "fetch-image": (403, get("/", Sec_Fetch_Site="cross-site", Sec_Fetch_Mode="no-cors")),
    # authentication
    "no-cookie": (401, get("/api/runs", Cookie=DROP)),
    "no-cookie-stop": (401, post("/api/stop", Cookie=DROP)),
    "no-cookie-file": (401, get("/files/run-1/summary.json", Cookie=DROP)),
    "no-cookie-unknown-route": (401, get("/api/none", Cookie=DROP)),
    "cookie-forged": (401, get("/api/runs", Cookie="stagectl-test=9999999999.x.00")),
    "cookie-unsigned": (401, get("/api/runs", Cookie="stagectl-test=9999999999.x.")),
    "cookie-of-another-name": (401, lambda v: request(v, "GET", "/api/runs", Cookie=v.cookie.replace("test", "x"))),  # noqa: E501
    "cookie-prolonged": (401, lambda v: request(v, "GET", "/api/runs", Cookie=v.cookie.replace("=1", "=2"))),  # noqa: E501
    "cookie-twice": (400, lambda v: request(v, "GET", "/api/runs", Cookie=[v.cookie] * 2)),
    "cookie-not-ascii": (401, get("/api/runs", Cookie="stagectl-test=\xff.\xff.\xff")),
    "token-in-address": (401, get("/api/runs?token=a-token-of-some-length", Cookie=DROP)),
    "token-as-bearer": (401, get("/api/runs", Cookie=DROP, Authorization="Bearer a-token-of-some-length")),  # noqa: E501
    "token-wrong": (401, post("/api/login", b'{"token": "a-token-of-some-lengtX"}')),
    "token-prefix": (401, post("/api/login", b'{"token": "a-token"}')),
    "token-empty": (401, post("/api/login", b'{"token": ""}')),
    "token-a-number": (422, post("/api/login", b'{"token": 0}')),
    "token-a-list": (422, post("/api/login", b'{"token": ["a-token-of-some-length"]}')),
    # methods: nothing is changed by GET
    "get-stop": (405, get("/api/stop")),
    "get-login": (405, get("/api/login?token=x")),
    "get-gap": (405, get("/api/gaps/start?runs=run-1")),
    "get-activate": (405, get("/api/maps/activate?number=1")),
    "head-stop": (405, lambda v: request(v, "HEAD", "/api/stop")),
    "put": (405, lambda v: request(v, "PUT", "/api/stop")),
    "delete": (405, lambda v: request(v, "DELETE", "/files/run-1/summary.json")),
    "options": (405, lambda v: request(v, "OPTIONS", "/api/stop")),
    "trace": (405, lambda v: request(v, "TRACE", "/")),
    "method-overridden": (405, get("/api/stop", X_HTTP_Method_Override="POST")),
    "post-a-file": (405, post("/files/run-1/summary.json")),
    "get-with-body": (400, get("/api/runs", Content_Length="2")),
    # content type: a form of another page needs no preflight for these
    "type-text": (415, post("/api/stop", Content_Type="text/plain")),
    "type-form": (415, post("/api/stop", Content_Type="application/x-www-form-urlencoded")),
    "type-multipart": (415, post("/api/stop", Content_Type="multipart/form-data; boundary=x")),
    "type-absent": (415, post("/api/stop", Content_Type=DROP)),
    "type-json-behind-text": (415, post("/api/stop", Content_Type="text/plain; application/json")),
    "type-json-like": (415, post("/api/stop", Content_Type="application/jsonp")),
    "type-utf-16": (415, post("/api/stop", Content_Type="application/json; charset=utf-16")),
    "type-twice": (400, post("/api/stop", Content_Type=["application/json", "text/plain"])),
    "compressed": (415, post("/api/stop", Content_Encoding="gzip")),
    # bodies
    "body-empty": (400, post("/api/stop", b"")),
    "body-not-json": (400, post("/api/stop", b"stop")),
    "body-not-utf-8": (400, post("/api/stop", b'{"\xff": 1}')),
    "body-nan": (400, post("/api/maps/page", b'{"number": NaN}')),
    "body-key-twice": (400, post("/api/ticket", b'{"name": "a", "name": "b"}')),
    "body-deep": (400, post("/api/stop", b"[" * 100_000)),
    "body-huge-number": (400, post("/api/maps/page", b'{"number": ' + b"9" * 5000 + b"}")),
    "body-unknown-key": (422, post("/api/stop", b'{"reason": "x"}')),
    "body-a-list": (422, post("/api/stop", b"[]")),
    "body-null": (422, post("/api/stop", b"null")),
    "body-prototype": (422, post("/api/stop", b'{"__proto__": {}}')),
    "body-said-too-large": (413, post("/api/stop", Content_Length=str(LARGEST + 1))),
    "body-length-negative": (400, post("/api/stop", Content_Length="-1")),
    "body-length-twice": (400, post("/api/stop", Content_Length=["2", "3"])),
    "body-chunked": (411, post("/api/stop", b"2\r\n{}\r\n0\r\n\r\n", Content_Length=DROP, Transfer_Encoding="chunked")),  # noqa: E501
    "name-with-line-break": (422, post("/api/ticket", b'{"name": "a\\nb"}')),
    "name-too-long": (422, post("/api/ticket", json.dumps({"name": "a" * 65}).encode())),
    "name-empty": (422, post("/api/ticket", b'{"name": ""}')),
    "map-not-a-number": (422, post("/api/maps/page", b'{"number": "1; rm"}')),
    "map-an-option": (422, post("/api/maps/activate", b'{"number": "--help"}')),
    "gap-of-nothing": (422, post("/api/gaps/start", b'{"runs": []}')),
    "gap-of-many": (422, post("/api/gaps/start", json.dumps({"runs": ["run-1"] * 21}).encode())),
    "gap-outside": (404, post("/api/gaps/start", b'{"runs": ["../outside"]}')),
    "gap-absolute": (404, post("/api/gaps/start", b'{"runs": ["/etc"]}')),
    "gap-an-option": (404, post("/api/gaps/start", b'{"runs": ["--html=/tmp/x"]}')),
    "gap-of-a-link": (404, post("/api/gaps/start", b'{"runs": ["link"]}')),
    # paths
    "path-up": (400, get("/files/../secret.json")),
    "path-up-encoded": (400, get("/files/%2e%2e/secret.json")),
    "path-slash-encoded": (400, get("/files/run-1/..%2f..%2fsecret.json")),
    "path-backslash": (400, get("/files/run-1/..\\secret.json")),
    "path-backslash-encoded": (400, get("/files/run-1/..%5c..%5csecret.json")),
    "path-encoded-twice": (400, get("/files/run-1/%252e%252e%252fsecret.json")),
    "path-overlong": (404, get("/files/run-1/%c0%ae%c0%ae%c0%afsecret.json")),
    "path-nul": (400, get("/files/run-1/summary.json%00.html")),
    "path-line-break": (400, get("/files/run-1/summary.json%0d%0aSet-Cookie:x")),
    "path-absolute": (400, get("/files//etc/passwd")),
    "path-hidden": (400, get("/files/run-1/.hidden.json")),
    "path-link": (404, get("/files/run-1/link.json")),
    "path-link-folder": (404, get("/files/link/secret.json")),
    "path-a-folder": (404, get("/files/run-1/folder.json")),
    "path-other-kind": (404, get("/files/run-1/recording.journal")),
    "path-full-width": (404, get("/files/%ef%bc%8e%ef%bc%8e/secret.json")),
    "path-too-long": (414, get("/files/run-1/" + "a" * 1100)),
    "path-name-too-long": (404, get("/files/run-1/" + "a" * 300 + ".json")),
    "query-too-long": (414, get("/api/runs?" + "a" * 1100)),
    "path-static-up": (400, get("/static/../app.py")),
    "path-static-up-encoded": (400, get("/static/%2e%2e/app.py")),
    "recipe-up": (400, get("/api/recipes/..%2fsecret.json")),
    "recipe-link": (404, get("/api/recipes/linked.yaml")),
    "scope-not-a-number": (400, get("/api/scope.csv?first=a")),
    "target-absolute": (400, get("http://attacker.example/api/runs")),
    # not HTTP, or too much of it
    "garbage": (400, lambda v: b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03\r\n\r\n"),
    "header-too-large": (431, get("/", X="a" * 70_000)),
    "header-folded": (421, lambda v: request(v, "GET", "/").replace(b"Cookie:", b" Cookie:", 1)),
    "zero-mq-greeting": (400, lambda v: b"\xff\x00\x00\x00\x00\x00\x00\x00\x01\x7f\x03\x00NULL\r\n\r\n"),  # noqa: E501
    # websocket handshakes
    "socket-no-cookie": (401, socket(Cookie=DROP)),
    "socket-no-origin": (403, socket(Origin=DROP)),
    "socket-foreign-origin": (403, socket(Origin="https://attacker.example")),
    "socket-null-origin": (403, socket(Origin="null")),
    "socket-foreign-host": (421, socket(Host="attacker.example")),
    "socket-no-ticket": (403, socket("/ws")),
    "socket-empty-ticket": (403, socket("/ws?ticket=")),
    "socket-wrong-ticket": (403, socket("/ws?ticket=abcdefghijklmnop")),
    "socket-two-tickets": (403, socket("/ws?ticket={ticket}&ticket=x")),
    "socket-ticket-and-more": (403, socket("/ws?ticket={ticket}&x=1")),
    "socket-token-as-ticket": (403, socket("/ws?ticket=a-token-of-some-length")),
    "socket-elsewhere": (404, socket("/api/runs?ticket={ticket}")),
    "socket-cross-site": (403, socket(Sec_Fetch_Site="cross-site")),
    "socket-path-up": (400, socket("/static/../ws?ticket={ticket}")),
}  # fmt: skip
assert len(HTTP) >= 80


@pytest.fixture(autouse=True)
def _unhurried(live):
    """The limits of rates have tests of their own."""
    live.console.gate.rates = live.console.gate.wrong_tokens = _Unlimited()


class _Unlimited:
    def allows(self, _):
        return True


@pytest.mark.parametrize("name", HTTP)
def test_hostile_request_is_refused(live, name):
    status, made = HTTP[name]
    assert live.raw(made(live)) == status


def test_the_stage_has_heard_nothing_of_them(live, fake):
    for _, made in HTTP.values():
        live.raw(made(live))
    assert fake.heard == []


def test_what_they_vary_is_answered(live, fake):
    assert live.raw(request(live, "GET", "/api/runs")) == 200
    assert live.raw(request(live, "GET", "/files/run-1/summary.json")) == 200
    assert live.raw(request(live, "POST", "/api/ticket", NAMED)) == 200
    assert live.raw(socket()(live)) == 101
    for _ in range(100):
        if live.raw(request(live, "POST", "/api/stop")) == 200:
            break
    assert [command.op for _, command in fake.heard][-1:] == ["stop"]
    fake.heard.clear()


REFUSED_COMMANDS = {
    "no-op": {},
    "unknown-op": {"op": "shutdown"},
    "op-not-text": {"op": 1},
    "unknown-key": {"op": "home", "x": 1},
    "wrong-type": {"op": "home", "force": "yes"},
    "beyond-any-stage": {"op": "move", "axis": "x", "position": 1e12},
    "two-targets": {"op": "move", "axis": "x", "position": 0.0, "distance": 0.0},
    "object-written": {"op": "write_object", "axis": "x", "index": 0x6060, "value": 1},
    "object-read": {"op": "read_object", "axis": "x", "index": 0x6064},
    "wait": {"op": "wait", "job": 1},
    "path-of-recipe": {"op": "check_recipe", "recipe": "recipe: a", "source": "/etc/passwd"},
    "path-up-of-recipe": {"op": "check_recipe", "recipe": "recipe: a", "source": "../secret.json"},
    "linked-recipe": {"op": "check_recipe", "recipe": "recipe: a", "source": "linked.yaml"},
    "table-elsewhere": {"op": "check_recipe", "source": "mine.yaml", "recipe": "sites: {file: ../secret.json}"},  # noqa: E501
    "absolute-table": {"op": "check_recipe", "source": "mine.yaml", "recipe": "sites: {file: /etc/passwd}"},  # noqa: E501
    "marks-elsewhere": {"op": "check_recipe", "source": "mine.yaml", "recipe": "fiducial: {file: /etc/passwd}"},  # noqa: E501
    "folder-of-run": {"op": "queue_add", "source": "mine.yaml", "recipe": "a", "folder": "/etc/x"},
    "run-to-resume": {"op": "queue_add", "source": "mine.yaml", "recipe": "a", "resume": "/etc"},
    "history": {"op": "queue_add", "source": "mine.yaml", "recipe": "a", "options": {"history": "/etc/x"}},  # noqa: E501
    "machine-file": {"op": "queue_add", "source": "mine.yaml", "recipe": "a", "machine": {"text": "machine: a", "source": "gap-1"}},  # noqa: E501
    "twin-elsewhere": {"op": "queue_add", "source": "mine.yaml", "recipe": "a", "machine": {"text": "", "source": "../run-1"}},  # noqa: E501
    "no-twin": {"op": "queue_add", "source": "mine.yaml", "recipe": "a", "machine": {"text": "", "source": "none"}},  # noqa: E501
    "recipe-too-long": {"op": "check_recipe", "source": "mine.yaml", "recipe": "a" * 1_000_001},
    "enable-without-command": {"op": "enable"},
    "move-without-command": {"op": "move", "axis": "x", "distance": 1e-3},
    "jog-without-command": {"op": "jog", "axis": "x", "velocity": 1e-3},
    "queue-without-command": {"op": "queue_start"},
    "acknowledge-without-command": {"op": "acknowledge", "alarm": 1},
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED_COMMANDS)
def test_hostile_command_is_refused(live, fake, name):
    with page(live) as opened:
        opened.send(json.dumps({"id": 1, "ask": REFUSED_COMMANDS[name], "begin": True}))
        assert answer(opened, 1)["refused"]["text"]
    assert fake.heard == []


def exhaust(page):
    """Receive until the connection ends."""
    while True:
        page.recv(60)


CLOSED = {
    "not-json": ("stop", 1007),
    "a-list": ("[]", 1007),
    "a-number": ("1", 1007),
    "no-id": ('{"ask": {"op": "home"}}', 1007),
    "id-not-a-number": ('{"id": "1", "ask": {"op": "home"}}', 1007),
    "id-true": ('{"id": true, "ask": {"op": "home"}}', 1007),
    "more-keys": ('{"id": 1, "ask": {"op": "home"}, "lease": "x"}', 1007),
    "token-in-first-frame": ('{"token": "a-token-of-some-length"}', 1007),
    "key-twice": ('{"id": 1, "id": 2, "ask": {"op": "home"}}', 1007),
    "infinite": ('{"id": 1, "ask": {"op": "jog", "axis": "x", "velocity": Infinity}}', 1007),
    "deep": ("[" * 100_000, 1007),
    "binary": (b"\x00\x01", 1003),
    "too-large": ("a" * (LARGEST + 1), 1009),
}


@pytest.mark.parametrize("name", CLOSED)
def test_hostile_frame_ends_the_connection(live, fake, name):
    frame, code = CLOSED[name]
    with page(live) as opened:
        opened.send(frame)
        with pytest.raises(websockets.exceptions.ConnectionClosed) as closed:
            exhaust(opened)
        assert closed.value.rcvd is not None
        assert closed.value.rcvd.code == code
    assert fake.heard == []
