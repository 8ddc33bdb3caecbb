"""The console's web application: its routes, by what they answer.

Nothing is changed by GET. What reaches the stage goes by the websocket (`session`); only Stop has a
route as well, so that it depends on neither.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket

from stagectl.client import Refused
from stagectl.console import records
from stagectl.console.access import SHIFT
from stagectl.console.bodies import Nothing, read_body
from stagectl.console.context import Context
from stagectl.console.folder import NoSuchFile
from stagectl.console.gate import LOG_IN, SOCKET, STOP, Gate, RefusedRequest
from stagectl.console.samples import as_csv, as_hdf5, columns
from stagectl.console.session import Session
from stagectl.errors import StagectlError
from stagectl.protocol.message import Message, Name, Text

_STATIC = Path(__file__).parent / "static"
_PLOTS = Path(__file__).parents[1] / "report" / "static"
MOST_SESSIONS = 32


class _LogIn(Message):
    token: Text


class _Ticket(Message):
    name: Name


def make_app(console: Context) -> Gate:
    """The application behind its gate."""

    @asynccontextmanager
    async def lifespan(app: Starlette) -> AsyncIterator[None]:
        watching = asyncio.create_task(console.link.run())
        yield
        watching.cancel()
        await asyncio.gather(watching, console.jobs.close(), return_exceptions=True)

    def get(path: str, answer: Callable[[Context, Request], Awaitable[Response]]) -> Route:
        return _route(console, path, answer, "GET")

    def post(path: str, answer: Callable[[Context, Request], Awaitable[Response]]) -> Route:
        return _route(console, path, answer, "POST")

    async def socket(websocket: WebSocket) -> None:
        await _serve_page(console, websocket)

    app = Starlette(
        routes=[
            get("/", _page),
            Mount("/static/plots", StaticFiles(directory=_PLOTS)),
            Mount("/static", StaticFiles(directory=_STATIC)),
            WebSocketRoute(SOCKET, socket),
            post(LOG_IN, _log_in),
            post(STOP, _stop),
            post("/api/ticket", _ticket),
            post("/api/server/start", _start_server),
            get("/api/recipes", records.recipes),
            get("/api/recipes/{name}", records.recipe),
            get("/api/runs", records.runs),
            post("/api/runs/compare", records.compare),
            get("/api/gaps", records.gaps),
            post("/api/gaps/start", records.diagnose),
            post("/api/gaps/cancel", records.cancel),
            get("/api/calibrations", records.calibrations),
            post("/api/calibrations/due", records.due),
            post("/api/calibrations/start", records.calibrate),
            get("/api/maps", records.maps),
            post("/api/maps/page", records.map_page),
            post("/api/maps/activate", records.activate),
            post("/api/maps/rollback", records.roll_back),
            get("/api/scope.csv", _scope_csv),
            get("/api/scope.h5", _scope_hdf5),
            get("/files/{folder}/{name}", records.file),
            get("/files/gaps/{folder}/{name}", records.gap_file),
        ],
        exception_handlers={HTTPException: _http_error},
        lifespan=lifespan,
    )
    console.gate = Gate(app, console.access, console.addresses, console.cookie)
    return console.gate


def _route(console: Context, path: str, answer: Any, method: str) -> Route:
    async def endpoint(request: Request) -> Response:
        try:
            response: Response = await answer(console, request)
            return response
        except RefusedRequest as why:
            return JSONResponse({"error": str(why)}, why.status)
        except NoSuchFile as why:
            return JSONResponse({"error": str(why)}, 404)
        except Refused as why:
            return JSONResponse({"error": str(why)}, 409)
        except StagectlError as why:
            return JSONResponse({"error": str(why)}, 409 if why.exit_code == 2 else 503)

    return Route(path, endpoint, methods=[method])


async def _http_error(request: Request, why: Exception) -> Response:
    assert isinstance(why, HTTPException)  # noqa: S101 (registered for it)
    return JSONResponse({"error": why.detail}, why.status_code, why.headers)


async def _serve_page(console: Context, websocket: WebSocket) -> None:
    if console.sessions >= MOST_SESSIONS:
        await websocket.send_denial_response(JSONResponse({"error": "too many pages"}, 429))
        return
    console.sessions += 1
    try:
        await Session(
            websocket,
            console.link,
            websocket.scope["operator"],
            console.recipes,
            lambda diagnosis: console.archive.twin(diagnosis),
            console.parts,
        ).run()
    finally:
        console.sessions -= 1


# The page, who uses it, and Stop.


async def _page(console: Context, request: Request) -> Response:
    return FileResponse(_STATIC / "index.html")


async def _log_in(console: Context, request: Request) -> Response:
    given = await read_body(request, _LogIn)
    cookie = console.access.log_in(given.token)
    if cookie is None:
        # the right one is always answered, so that nobody can lock others out
        if not console.gate.wrong_tokens.allows(request.client.host if request.client else ""):
            raise RefusedRequest(429, "too many wrong tokens")
        raise RefusedRequest(401, "wrong token")
    response = JSONResponse({})
    response.set_cookie(
        console.cookie, cookie, max_age=int(SHIFT), httponly=True, samesite="strict",
        secure=request.headers["origin"].startswith("https:"),
    )  # fmt: skip
    return response


async def _ticket(console: Context, request: Request) -> Response:
    asked = await read_body(request, _Ticket)
    ticket = console.access.give_ticket(request.scope["session"], asked.name)
    if ticket is None:
        raise RefusedRequest(429, "too many tickets wait to be used")
    return JSONResponse({"ticket": ticket})


async def _stop(console: Context, request: Request) -> Response:
    await read_body(request, Nothing)
    await console.link.stop("in the console")
    return JSONResponse({})


async def _start_server(console: Context, request: Request) -> Response:
    await read_body(request, Nothing)
    if console.server is None:
        raise StagectlError("this console watches a server that it has not started")
    console.server.start()
    return JSONResponse({})


# Files.


async def _scope_csv(console: Context, request: Request) -> Response:
    stretch, names, _ = _stretch(console, request)
    return _download(await run_in_threadpool(as_csv, stretch, names), "scope.csv", "text/csv")


async def _scope_hdf5(console: Context, request: Request) -> Response:
    stretch, names, about = _stretch(console, request)
    made = await run_in_threadpool(as_hdf5, stretch, names, about)
    return _download(made, "scope.h5", "application/x-hdf5")


def _stretch(console: Context, request: Request) -> tuple[Any, list[str], str]:
    """The samples that a request names: all that are kept, or from `first` on, `count` of them."""
    served = console.link.info
    if served is None:
        raise StagectlError(console.link.why or "no stage server")
    try:
        first, count = (
            int(request.query_params.get(k, d)) for k, d in (("first", 0), ("count", -1))
        )
    except ValueError:
        raise RefusedRequest(400, "first and count are whole numbers") from None
    stretch = console.link.ring.since(max(first, 0), count if count > 0 else 1 << 30)
    return (
        stretch,
        columns([axis.name for axis in served.axes]),
        f"{served.machine} on {served.bus}",
    )


def _download(data: bytes, name: str, kind: str) -> Response:
    return Response(data, headers={"content-disposition": f'attachment; filename="{name}"'},
                    media_type=kind)  # fmt: skip
