"""Who commands the stage: one client at a time, under a name that all see."""

from __future__ import annotations

import hmac
import secrets
import time

from stagectl.protocol.state import Lease

KEPT = 15.0
"""How long command is kept without a request of its holder [s]."""


class CommandLease:
    """Held by one client, or by none: then whoever asks commands for that one request."""

    def __init__(self) -> None:
        self._token: str | None = None
        self._holder, self._since, self._renewed = "", 0.0, 0.0

    @property
    def held(self) -> Lease | None:
        """Who commands, or None."""
        if self._token is not None and time.monotonic() - self._renewed > KEPT:
            self._token = None
        return None if self._token is None else Lease(holder=self._holder, since=self._since)

    def renew(self, token: str | None) -> bool:
        """Whether this is the holder's token; it is then kept for longer."""
        if token is None or self.held is None or self._token is None:
            return False
        if not hmac.compare_digest(token.encode(), self._token.encode()):
            return False
        self._renewed = time.monotonic()
        return True

    def take(self, client: str) -> str:
        """Give command to a client; returns its token."""
        self._token, self._holder = secrets.token_urlsafe(24), client
        self._since, self._renewed = time.time(), time.monotonic()
        return self._token

    def release(self, token: str | None) -> bool:
        """Give command back; returns whether it was the holder who asked."""
        if not self.renew(token):
            return False
        self._token = None
        return True
