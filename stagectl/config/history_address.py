"""Addresses of histories: a file, or a PostgreSQL server in any form that libpq takes.

A server's address may hold a password. It goes neither into a message nor into a recording; libpq
finds it in PGPASSWORD or ~/.pgpass.
"""

from __future__ import annotations

import re
from pathlib import Path
from urllib.parse import unquote

OFF = "none"
"""In place of a path: no history."""
UNNAMED = "PostgreSQL"
"""Name of a server whose address cannot be shown safely."""
_PAIR = re.compile(r"(?:^|\s)(?:host|hostaddr|port|dbname|user|(?:ssl)?password|service)\s*=")
_USER = re.compile(r"(?P<user>[^@/:]*)[^@/]*@")  # as in libpq
_PASSWORDS = ("password", "sslpassword")
_HOST, _DATABASE, _PORT = (
    re.compile(r"[\w.,:/\[\]-]*"),
    re.compile(r"[\w.-]*"),
    re.compile(r"[\d,]*"),
)


def is_server(where: str) -> bool:
    """Whether `where` is a URL or libpq's `host=... dbname=...`, not a path."""
    return "://" in where or _PAIR.search(where) is not None


def is_path(where: str) -> bool:
    """Whether `where` names a file."""
    return where != OFF and not is_server(where)


def without_password(where: str) -> str:
    """The history's name for a recording: an absolute path, or an address without password."""
    if not is_server(where):
        return str(Path(where).absolute())
    scheme, mark, rest = where.partition("://")
    if not mark:
        pairs = _parse(where)
        return UNNAMED if pairs is None else _join(pairs)
    if given := _USER.match(rest):
        rest = f"{given['user']}@{rest[given.end() :]}"
    rest, _, query = rest.partition("?")
    options = [o for o in query.split("&") if unquote(o.partition("=")[0]) not in _PASSWORDS]
    return f"{scheme}://{rest}" + (f"?{'&'.join(options)}" if query and options else "")


def shown_address(where: str) -> str:
    """The history's name in messages: a path as given, or a server without user and password.

    A server is named only as libpq understands its address, and only if that leaves no doubt: with
    a slash or an @ in it, part of a password may pass for a host, port or database.
    """
    if not is_server(where):
        return where
    pairs = _parse(where) or {}
    host, port = pairs.get("host", ""), pairs.get("port", "")
    database = pairs.get("dbname", "")
    plain = _HOST.fullmatch(host) and _PORT.fullmatch(port) and _DATABASE.fullmatch(database)
    if not pairs or not plain:
        return UNNAMED
    return f"postgresql://{host}{f':{port}' if port else ''}/{database}"


def hide_passwords(text: str, where: str) -> str:
    """A message of libpq about an address, without the passwords in it."""
    for key, value in (_parse(where) or {}).items():
        if key in _PASSWORDS and value:
            text = text.replace(value, "***")
    return text


def _parse(where: str) -> dict[str, str] | None:
    """An address as libpq understands it; None where it does not, or is not installed."""
    try:
        from psycopg import Error
        from psycopg.conninfo import conninfo_to_dict
    except ImportError:
        return None
    try:
        return {key: str(value) for key, value in conninfo_to_dict(where).items()}
    except Error:
        return None


def _join(pairs: dict[str, str]) -> str:
    from psycopg.conninfo import make_conninfo

    return make_conninfo("", **{k: v for k, v in pairs.items() if k not in _PASSWORDS})
