"""Bodies of requests: strict JSON, of limited size, within limited time."""

from __future__ import annotations

import asyncio
import json
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError
from starlette.requests import ClientDisconnect, Request

from stagectl.console.gate import LARGEST, RefusedRequest
from stagectl.protocol.message import Message
from stagectl.protocol.wire import one_problem

TIMEOUT = 10.0
"""For a body to arrive [s]."""
Model = TypeVar("Model", bound=BaseModel)


class Nothing(Message):
    """A body without content: `{}`."""


class BadBody(ValueError):  # noqa: N818
    """Not the JSON that is expected."""


def parse_json(text: str | bytes) -> Any:
    """Values of JSON text.

    Raises:
        BadBody: it is not JSON: NaN and repeated keys included.
    """
    try:
        return json.loads(text, parse_constant=_refuse_constant, object_pairs_hook=_unique)
    except (ValueError, RecursionError) as why:
        raise BadBody(f"not JSON: {type(why).__name__}") from why


async def read_body(request: Request, model: type[Model]) -> Model:
    """The body of a request.

    Raises:
        RefusedRequest: too large (413), too slow (408), not JSON (400), not as the model (422).
    """
    try:
        async with asyncio.timeout(TIMEOUT):
            body = b""
            async for part in request.stream():
                body += part
                if len(body) > LARGEST:
                    raise RefusedRequest(413, f"at most {LARGEST} bytes")
    except TimeoutError:
        raise RefusedRequest(408, "the body did not arrive") from None
    except ClientDisconnect:
        raise RefusedRequest(400, "the body did not arrive") from None
    try:
        values = parse_json(body)
        return model.model_validate_json(json.dumps(values), strict=True)
    except BadBody as why:
        raise RefusedRequest(400, str(why)) from why
    except ValidationError as why:
        raise RefusedRequest(422, one_problem(why)) from why


def _refuse_constant(name: str) -> None:
    raise ValueError(name)


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    made = dict(pairs)
    if len(made) != len(pairs):
        raise ValueError("a key is repeated")
    return made
