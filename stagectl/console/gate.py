"""What every request passes before the application sees it; what is not allowed here is refused.

Host against DNS rebinding, Origin and Fetch metadata against other pages, the cookie, the form of
paths and bodies, rates. Peers' addresses and forwarding headers count for nothing. All responses
leave with the security headers, a stricter policy of their own aside.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from http.cookies import CookieError, SimpleCookie
from urllib.parse import urlsplit

from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from stagectl.console.access import Access
from stagectl.errors import UnusableInput
from stagectl.rates import Rates

LARGEST = 1_200_000
"""Bytes of a body: a recipe of a million characters."""
STOP, LOG_IN, SOCKET = "/api/stop", "/api/login", "/ws"
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
_HEADERS = {
    "content-security-policy": POLICY,
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "permissions-policy": "camera=(), geolocation=(), microphone=(), usb=(), serial=()",
    "cache-control": "no-store",
}
_MOST_HEADERS = 16384
_ONCE = (b"host", b"origin", b"content-type", b"content-length", b"sec-fetch-site", b"cookie")
_BAD_PATH = re.compile(rb"%(?:2f|5c|25|[01][0-9a-f]|7f)|[\\\x00-\x20\x7f-\xff]|/\.\.?(?:/|$)|//",
                       re.IGNORECASE)  # fmt: skip
_JSON = re.compile(r'application/json(?:; *charset="?utf-8"?)?', re.IGNORECASE)


class RefusedRequest(Exception):  # noqa: N818
    """A request is refused.

    Attributes:
        status: of HTTP.
    """

    def __init__(self, status: int, text: str) -> None:
        super().__init__(text)
        self.status = status


@dataclass(frozen=True)
class Addresses:
    """Under which addresses the page may be reached.

    Attributes:
        hosts: values of the Host header.
        origins: values of the Origin header.
    """

    hosts: frozenset[str]
    origins: frozenset[str]

    @classmethod
    def of(cls, host: str, port: int, origins: Iterable[str]) -> Addresses:
        """Of a listening socket, and of the proxies in front of it.

        Raises:
            UnusableInput: an origin is not one.
        """
        names = {"127.0.0.1", "localhost", "[::1]"} if is_loopback(host) else set()
        names.add(f"[{host}]" if ":" in host else host)
        hosts = {f"{name}:{port}" for name in names}
        allowed = {f"http://{name}" for name in hosts}
        for origin in origins:
            parts = urlsplit(origin)
            if (
                parts.scheme not in ("http", "https")
                or origin != f"{parts.scheme}://{parts.netloc}"
            ):
                raise UnusableInput(f"--origin {origin}: not of the form https://stage.example")
            if not parts.netloc or "@" in parts.netloc or parts.netloc != parts.netloc.lower():
                raise UnusableInput(f"--origin {origin}: not of the form https://stage.example")
            hosts.add(parts.netloc)
            allowed.add(origin)
        return cls(frozenset(hosts), frozenset(allowed))


def is_loopback(host: str) -> bool:
    """Whether an address is this machine's own."""
    return host in ("localhost", "::1") or re.fullmatch(r"127(\.\d{1,3}){3}", host) is not None


class Gate:
    """The middleware.

    Args:
        app: behind it.
        access: who may.
        addresses: under which it is reached.
        cookie: name of the cookie.

    Attributes:
        rates: of a session's requests, Stop aside.
        wrong_tokens: of a peer's.
    """

    def __init__(self, app: ASGIApp, access: Access, addresses: Addresses, cookie: str) -> None:
        self.app, self._access, self._addresses = app, access, addresses
        self._cookie = cookie
        self.rates = Rates(rate=30, burst=120)
        self.wrong_tokens = Rates(rate=0.5, burst=10)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Refuse, or pass on with `scope["session"]`."""
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
            return
        try:
            self._check(scope)
        except RefusedRequest as why:
            await refuse(why, scope, receive, _with_headers(send))
            return
        await self.app(scope, receive, _with_headers(send))

    def _check(self, scope: Scope) -> None:
        headers = _headers(scope)
        _check_path(scope)
        if headers.get("host", "").lower() not in self._addresses.hosts:
            raise RefusedRequest(421, "not the address of this console")
        is_socket, path = scope["type"] == "websocket", scope["path"]
        if not is_socket and scope["method"] not in ("GET", "HEAD", "POST"):
            raise RefusedRequest(405, "GET and POST only")
        self._check_origin(headers, is_socket or scope["method"] == "POST", path)
        if not is_socket:
            _check_body(headers, scope["method"])
        scope["session"] = session = self._session(headers)
        if path == LOG_IN:
            return
        if session is None:
            if is_socket or not (path == "/" or path.startswith("/static/")):
                raise RefusedRequest(401, "log in first")
        elif path != STOP and not self.rates.allows(session):
            raise RefusedRequest(429, "too many requests")
        if is_socket:
            self._check_ticket(scope, path, session or "")

    def _check_origin(self, headers: dict[str, str], needed: bool, path: str) -> None:
        origin = headers.get("origin")
        if origin is None and needed:
            raise RefusedRequest(403, "no Origin")
        if origin is not None and origin not in self._addresses.origins:
            raise RefusedRequest(403, "another page's request")
        if headers.get("sec-fetch-site", "none") not in ("same-origin", "none"):
            # a link elsewhere may lead to the page itself, which says nothing before the log-in
            if path != "/" or headers.get("sec-fetch-mode") != "navigate":
                raise RefusedRequest(403, "another page's request")

    def _session(self, headers: dict[str, str]) -> str | None:
        try:
            found = SimpleCookie(headers.get("cookie", "")).get(self._cookie)
        except CookieError:
            return None
        return None if found is None else self._access.session(found.value)

    def _check_ticket(self, scope: Scope, path: str, session: str) -> None:
        if path != SOCKET:
            raise RefusedRequest(404, "no such socket")
        match = re.fullmatch(rb"ticket=([A-Za-z0-9_-]{1,64})", scope["query_string"])
        name = match and self._access.redeem(match[1].decode(), session)
        if name is None:
            raise RefusedRequest(403, "no valid ticket")
        scope["operator"] = name


def _headers(scope: Scope) -> dict[str, str]:
    """By lower-case name; those that decide something may be there once."""
    found: dict[str, str] = {}
    if sum(len(name) + len(value) for name, value in scope["headers"]) > _MOST_HEADERS:
        raise RefusedRequest(431, "too much in the headers")
    for name, value in scope["headers"]:
        if name in _ONCE and name.decode() in found:
            raise RefusedRequest(400, f"{name.decode()}: given twice")
        found[name.decode("latin-1")] = value.decode("latin-1")
    return found


def _check_path(scope: Scope) -> None:
    path: bytes = scope.get("raw_path") or scope["path"].encode()
    if len(path) > 1024 or len(scope["query_string"]) > 1024:
        raise RefusedRequest(414, "the address is too long")
    if not path.startswith(b"/") or _BAD_PATH.search(path):
        raise RefusedRequest(400, "no such path")
    if not scope["path"].isprintable() or re.search(r"/\.", scope["path"]):
        raise RefusedRequest(400, "no such path")


def _check_body(headers: dict[str, str], method: str) -> None:
    length = headers.get("content-length")
    if method != "POST":
        if "transfer-encoding" in headers or length not in (None, "0"):
            raise RefusedRequest(400, f"{method} has no body")
        return
    if not _JSON.fullmatch(headers.get("content-type", "")) or "content-encoding" in headers:
        raise RefusedRequest(415, "application/json only")
    if length is None or not length.isdecimal():
        raise RefusedRequest(411, "no Content-Length")
    if len(length) > 9 or int(length) > LARGEST:
        raise RefusedRequest(413, f"at most {LARGEST} bytes")


async def refuse(why: RefusedRequest, scope: Scope, receive: Receive, send: Send) -> None:
    """Answer a refused request, or websocket handshake, with its status."""
    headers = {"allow": "GET, HEAD, POST"} if why.status == 405 else {}
    response = JSONResponse({"error": str(why)}, why.status, headers)
    if scope["type"] == "websocket" and "websocket.http.response" not in scope["extensions"]:
        await send({"type": "websocket.close", "code": 1008})
        return
    await response(scope, receive, send)


def _with_headers(send: Send) -> Send:
    async def secured(message: Message) -> None:
        if message["type"] in ("http.response.start", "websocket.http.response.start"):
            given = {name for name, _ in message.setdefault("headers", [])}
            message["headers"] = [
                *message["headers"],
                *((n.encode(), v.encode()) for n, v in _HEADERS.items() if n.encode() not in given),
            ]
        await send(message)

    return secured
