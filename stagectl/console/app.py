"""The console's web application: its routes, by what they answer.

Nothing is changed by GET. What reaches the stage goes by the websocket (`session`); only Stop has a
route as well, so that it depends on neither.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from annotated_types import Len
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket

from stagectl.client import Refused
from stagectl.console.access import SHIFT, Access
from stagectl.console.archive import Archive
from stagectl.console.bodies import read_body
from stagectl.console.folder import NoSuchFile
from stagectl.console.gate import LOG_IN, SOCKET, STOP, Addresses, Gate, RefusedRequest
from stagectl.console.jobs import Jobs
from stagectl.console.link import StageLink
from stagectl.console.recipes import Recipes
from stagectl.console.samples import columns
from stagectl.console.scope_export import as_csv, as_hdf5
from stagectl.console.server_process import ServerProcess
from stagectl.console.session import Session
from stagectl.errors import StagectlError
from stagectl.protocol.message import Index, Message, Name, Text

_STATIC = Path(__file__).parent / "static"
_PLOTS = Path(__file__).parents[1] / "report" / "static"
MOST_SESSIONS = 32
Names = Annotated[tuple[Name, ...], Len(1, 20)]


class _LogIn(Message):
    token: Text


class _Ticket(Message):
    name: Name


class _Nothing(Message):
    pass


class _Diagnose(Message):
    runs: Names


class _Calibrate(Message):
    sites: Name
    due: bool
    operator: Name


class _Map(Message):
    number: Index | None = None


@dataclass
class Console:
    """What the routes work with.

    Attributes:
        access, addresses: who may, and under which address.
        cookie: its name.
        link: to the stage server.
        server: the process that the console starts it as, or None.
        recipes: that the page offers.
        jobs: diagnoses and the like.
        data: folder of runs where no server names one.
    """

    access: Access
    addresses: Addresses
    cookie: str
    link: StageLink
    server: ServerProcess | None
    recipes: Recipes
    jobs: Jobs
    data: Path

    def __post_init__(self) -> None:
        self.sessions = 0
        self.gate: Gate

    @property
    def archive(self) -> Archive:
        """The data folder."""
        served = self.link.info
        return Archive(self.data if served is None else Path(served.data))

    def parts(self) -> dict[str, Any]:
        """Parts of the page's state that do not come from the stage server."""
        return {
            "process": None if self.server is None else self.server.status(),
            "job_beside": self.jobs.as_dict(),
        }


def make_app(console: Console) -> Gate:
    """The application behind its gate."""

    @asynccontextmanager
    async def lifespan(app: Starlette) -> AsyncIterator[None]:
        watching = asyncio.create_task(console.link.run())
        yield
        watching.cancel()
        await asyncio.gather(watching, console.jobs.close(), return_exceptions=True)

    def get(path: str, answer: Callable[[Console, Request], Awaitable[Response]]) -> Route:
        return _route(console, path, answer, "GET")

    def post(path: str, answer: Callable[[Console, Request], Awaitable[Response]]) -> Route:
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
            get("/api/recipes", _recipes),
            get("/api/recipes/{name}", _recipe),
            get("/api/runs", _runs),
            get("/api/gaps", _gaps),
            post("/api/gaps/start", _diagnose),
            post("/api/gaps/cancel", _cancel),
            get("/api/calibrations", _calibrations),
            post("/api/calibrations/due", _due),
            post("/api/calibrations/start", _calibrate),
            get("/api/maps", _maps),
            post("/api/maps/page", _map_page),
            post("/api/maps/activate", _activate),
            post("/api/maps/rollback", _roll_back),
            get("/api/scope.csv", _scope_csv),
            get("/api/scope.h5", _scope_hdf5),
            get("/files/{folder}/{name}", _file),
            get("/files/gaps/{folder}/{name}", _gap_file),
        ],
        exception_handlers={HTTPException: _http_error},
        lifespan=lifespan,
    )
    console.gate = Gate(app, console.access, console.addresses, console.cookie)
    return console.gate


def _route(console: Console, path: str, answer: Any, method: str) -> Route:
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


async def _serve_page(console: Console, websocket: WebSocket) -> None:
    if console.sessions >= MOST_SESSIONS:
        await websocket.send_denial_response(JSONResponse({"error": "too many pages"}, 429))
        return
    console.sessions += 1
    try:
        await Session(
            websocket, console.link, websocket.scope["operator"], console.recipes, console.parts
        ).run()
    finally:
        console.sessions -= 1


# The page, who uses it, and Stop.


async def _page(console: Console, request: Request) -> Response:
    return FileResponse(_STATIC / "index.html")


async def _log_in(console: Console, request: Request) -> Response:
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


async def _ticket(console: Console, request: Request) -> Response:
    asked = await read_body(request, _Ticket)
    ticket = console.access.give_ticket(request.scope["session"], asked.name)
    if ticket is None:
        raise RefusedRequest(429, "too many tickets wait to be used")
    return JSONResponse({"ticket": ticket})


async def _stop(console: Console, request: Request) -> Response:
    await read_body(request, _Nothing)
    await console.link.stop("in the console")
    return JSONResponse({})


async def _start_server(console: Console, request: Request) -> Response:
    await read_body(request, _Nothing)
    if console.server is None:
        raise StagectlError("this console watches a server that it has not started")
    console.server.start()
    return JSONResponse({})


# Recipes, runs, diagnoses, maps.


async def _recipes(console: Console, request: Request) -> Response:
    return JSONResponse(await run_in_threadpool(console.recipes.names))


async def _recipe(console: Console, request: Request) -> Response:
    text = await run_in_threadpool(console.recipes.read, request.path_params["name"])
    return JSONResponse({"text": text})


async def _runs(console: Console, request: Request) -> Response:
    return JSONResponse(await run_in_threadpool(console.archive.runs))


async def _gaps(console: Console, request: Request) -> Response:
    return JSONResponse(await run_in_threadpool(console.archive.gaps))


async def _diagnose(console: Console, request: Request) -> Response:
    asked = await read_body(request, _Diagnose)
    folder, arguments = await run_in_threadpool(console.archive.diagnosis, asked.runs)
    console.jobs.begin(f"diagnosis of {', '.join(asked.runs)}", folder, arguments)
    return JSONResponse({"folder": folder.name})


async def _cancel(console: Console, request: Request) -> Response:
    await read_body(request, _Nothing)
    console.jobs.cancel()
    return JSONResponse({})


async def _calibrations(console: Console, request: Request) -> Response:
    return JSONResponse(await run_in_threadpool(console.recipes.names, "calibrate"))


async def _due(console: Console, request: Request) -> Response:
    asked = await read_body(request, _Calibrate)
    looking = (*_on_server(console), "--due", "--dry-run", "--json", "-")
    sites = await run_in_threadpool(console.recipes.path, asked.sites, "calibrate")
    found = await console.jobs.ask(console.archive.calibrate_command(sites, *looking))
    return Response(found, media_type="application/json")


async def _calibrate(console: Console, request: Request) -> Response:
    asked = await read_body(request, _Calibrate)
    sites = await run_in_threadpool(console.recipes.path, asked.sites, "calibrate")
    due = ("--due",) if asked.due else ()
    options = (*_on_server(console), "--operator", asked.operator, *due)
    command = console.archive.calibrate_command(sites, *options)
    console.jobs.begin(f"calibration by {sites.name}", sites, command)
    return JSONResponse({})


def _on_server(console: Console) -> tuple[str, ...]:
    """Options that name the stage server, and its machine file where it is one."""
    return ("--server", console.link.where.name, *_machine(console))


def _machine(console: Console) -> tuple[str, ...]:
    served = console.link.info
    if served is None or not Path(served.machine_file).is_file():
        return ()
    return ("--machine", served.machine_file)


async def _maps(console: Console, request: Request) -> Response:
    arguments = console.archive.map_command("history", "--json", "-")
    return Response(await console.jobs.ask(arguments), media_type="application/json")


async def _map_page(console: Console, request: Request) -> Response:
    asked = await read_body(request, _Map)
    number = () if asked.number is None else (str(asked.number),)
    page = await run_in_threadpool(console.archive.map_page)
    await console.jobs.ask(console.archive.map_command("show", *number, "--html", str(page)))
    return JSONResponse({"page": f"/files/{page.parent.name}/{page.name}"})


async def _activate(console: Console, request: Request) -> Response:
    asked = await read_body(request, _Map)
    return await _use_map(
        console, "activate", *(() if asked.number is None else (str(asked.number),))
    )


async def _roll_back(console: Console, request: Request) -> Response:
    await read_body(request, _Nothing)
    return await _use_map(console, "rollback")


async def _use_map(console: Console, *arguments: str) -> Response:
    said = await console.jobs.ask(console.archive.map_command(*arguments, *_machine(console)))
    return JSONResponse({"said": said.strip()})


# Files.


async def _scope_csv(console: Console, request: Request) -> Response:
    stretch, names, _ = _stretch(console, request)
    return _download(await run_in_threadpool(as_csv, stretch, names), "scope.csv", "text/csv")


async def _scope_hdf5(console: Console, request: Request) -> Response:
    stretch, names, about = _stretch(console, request)
    made = await run_in_threadpool(as_hdf5, stretch, names, about)
    return _download(made, "scope.h5", "application/x-hdf5")


def _stretch(console: Console, request: Request) -> tuple[Any, list[str], str]:
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


async def _file(console: Console, request: Request) -> Response:
    folder, name = request.path_params["folder"], request.path_params["name"]
    return await run_in_threadpool(console.archive.file, folder, name)


async def _gap_file(console: Console, request: Request) -> Response:
    folder, name = request.path_params["folder"], request.path_params["name"]
    return await run_in_threadpool(console.archive.file, "gaps", folder, name)


def _download(data: bytes, name: str, kind: str) -> Response:
    return Response(data, headers={"content-disposition": f'attachment; filename="{name}"'},
                    media_type=kind)  # fmt: skip
