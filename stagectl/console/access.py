"""Who may use the console: one token, cookies signed with it, one-shot tickets for websockets.

The token is never part of an address that a server sees: the printed one has it behind `#`. The
page exchanges it for a cookie that scripts cannot read and other sites' requests do not carry.
"""

from __future__ import annotations

import hashlib
import hmac
import secrets
import time
from collections.abc import Callable
from dataclasses import dataclass

from stagectl.errors import UnusableInput

SHIFT = 16 * 3600.0
"""How long a cookie is valid [s]."""
TICKET = 10.0
"""How long a ticket is valid [s]."""
_SHORTEST = 16
_MOST_TICKETS = 64


def check_token(text: str, source: str) -> str:
    """A token from a file.

    Raises:
        UnusableInput: it is too short, or not one line of printable ASCII.
    """
    token = text.strip()
    if len(token) < _SHORTEST or not token.isascii() or not token.isprintable() or " " in token:
        raise UnusableInput(
            f"{source}: a token has one line of {_SHORTEST} or more ASCII characters"
        )
    return token


@dataclass(frozen=True, slots=True)
class _Ticket:
    session: str
    name: str
    until: float


class Access:
    """Checks tokens, cookies and tickets.

    Args:
        token: that opens the console.
        clock: seconds since 1970.
    """

    def __init__(self, token: str, clock: Callable[[], float] = time.time) -> None:
        self._token = token.encode()
        self._key = hashlib.sha256(b"stagectl console cookie\n" + self._token).digest()
        self._clock = clock
        self._tickets: dict[str, _Ticket] = {}

    def log_in(self, given: str) -> str | None:
        """A cookie for the right token, else None; takes the same time for every wrong one."""
        if not hmac.compare_digest(hashlib.sha256(given.encode()).digest(),
                                   hashlib.sha256(self._token).digest()):  # fmt: skip
            return None
        content = f"{int(self._clock() + SHIFT)}.{secrets.token_urlsafe(12)}"
        return f"{content}.{self._sign(content)}"

    def session(self, cookie: str) -> str | None:
        """The session of a cookie; None if it is not one of ours, or has expired."""
        content, _, signature = cookie.rpartition(".")
        if not hmac.compare_digest(signature.encode(), self._sign(content).encode()):
            return None
        until, _, session = content.partition(".")
        return session if float(until) > self._clock() else None

    def give_ticket(self, session: str, name: str) -> str | None:
        """A ticket for one websocket; None where too many wait to be used."""
        now = self._clock()
        self._tickets = {key: t for key, t in self._tickets.items() if t.until > now}
        if len(self._tickets) >= _MOST_TICKETS:
            return None
        ticket = secrets.token_urlsafe(24)
        self._tickets[ticket] = _Ticket(session, name, now + TICKET)
        return ticket

    def redeem(self, ticket: str, session: str) -> str | None:
        """The name that a ticket was given to, once; None where it is not valid."""
        found = self._tickets.pop(ticket, None)
        if found is None or found.session != session or found.until <= self._clock():
            return None
        return found.name

    def _sign(self, content: str) -> str:
        return hmac.new(self._key, content.encode(), hashlib.sha256).hexdigest()
