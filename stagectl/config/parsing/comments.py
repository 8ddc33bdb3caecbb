"""Passwords in the comments of a file, which recordings and reports pass on with its text.

An address that was tried and left behind a # is no value, so no key says what it is: what looks
like the password of a URL, or follows a word for one and `=` or `:`, is taken out.
"""

from __future__ import annotations

import re

_COMMENT = re.compile(r"(?m)(?:^|(?<=\s))#.*$")
_URL = re.compile(r"(\b[a-z][a-z0-9+.-]*://[^\s:/@]*):\S*@", re.IGNORECASE)
_WORD = re.compile(
    r"(\w*(?:password|passwd|passphrase|pwd|secret)\w*[\"']?\s*[=:]\s*)(\"[^\"\n]*\"|'[^'\n]*'|\S+)",
    re.IGNORECASE,
)


def without_passwords(text: str) -> str:
    """A file's text without what looks like a password in its comments; the rest as it is."""
    return _COMMENT.sub(lambda found: _WORD.sub(r"\1***", _URL.sub(r"\1@", found[0])), text)
