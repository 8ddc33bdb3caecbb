"""Routes to what is on disk, and to the commands that make it: recipes, runs, gaps, maps, files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from annotated_types import Len
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from stagectl.console.bodies import Nothing, read_body
from stagectl.console.context import Context
from stagectl.protocol.message import Index, Message, Name

Names = Annotated[tuple[Name, ...], Len(1, 20)]


class _Diagnose(Message):
    runs: Names


class _Compare(Message):
    before: Name
    after: Name


class _Calibrate(Message):
    sites: Name
    due: bool
    operator: Name


class _Map(Message):
    number: Index | None = None


async def recipes(console: Context, request: Request) -> Response:
    """File names of recipes."""
    return JSONResponse(await run_in_threadpool(console.recipes.names))


async def recipe(console: Context, request: Request) -> Response:
    """The text of a recipe."""
    text = await run_in_threadpool(console.recipes.read, request.path_params["name"])
    return JSONResponse({"text": text})


async def runs(console: Context, request: Request) -> Response:
    """All runs."""
    return JSONResponse(await run_in_threadpool(console.archive.runs))


async def compare(console: Context, request: Request) -> Response:
    """How much closer the machine file of a run is than that of an earlier one."""
    asked = await read_body(request, _Compare)
    command = await run_in_threadpool(console.archive.compare_command, asked.before, asked.after)
    return Response(await console.jobs.ask(command), media_type="application/json")


async def gaps(console: Context, request: Request) -> Response:
    """All diagnoses."""
    return JSONResponse(await run_in_threadpool(console.archive.gaps))


async def diagnose(console: Context, request: Request) -> Response:
    """Begin with a diagnosis of recordings."""
    asked = await read_body(request, _Diagnose)
    folder, arguments = await run_in_threadpool(console.archive.diagnosis, asked.runs)
    console.jobs.begin(f"diagnosis of {', '.join(asked.runs)}", folder, arguments)
    return JSONResponse({"folder": folder.name})


async def cancel(console: Context, request: Request) -> Response:
    """End the command under way."""
    await read_body(request, Nothing)
    console.jobs.cancel()
    return JSONResponse({})


async def calibrations(console: Context, request: Request) -> Response:
    """File names of calibrations."""
    return JSONResponse(await run_in_threadpool(console.recipes.names, "calibrate"))


async def due(console: Context, request: Request) -> Response:
    """Which sites of a calibration are due."""
    asked = await read_body(request, _Calibrate)
    looking = (*_on_server(console), "--due", "--dry-run", "--json", "-")
    sites = await run_in_threadpool(console.recipes.path, asked.sites, "calibrate")
    found = await console.jobs.ask(console.archive.calibrate_command(sites, *looking))
    return Response(found, media_type="application/json")


async def calibrate(console: Context, request: Request) -> Response:
    """Begin with a calibration on the stage server."""
    asked = await read_body(request, _Calibrate)
    sites = await run_in_threadpool(console.recipes.path, asked.sites, "calibrate")
    due = ("--due",) if asked.due else ()
    options = (*_on_server(console), "--operator", asked.operator, *due)
    command = console.archive.calibrate_command(sites, *options)
    console.jobs.begin(f"calibration by {sites.name}", sites, command)
    return JSONResponse({})


def _on_server(console: Context) -> tuple[str, ...]:
    """Options that name the stage server, and its machine file where it is one."""
    return ("--server", console.link.where.name, *_machine(console))


def _machine(console: Context) -> tuple[str, ...]:
    served = console.link.info
    if served is None or not Path(served.machine_file).is_file():
        return ()
    return ("--machine", served.machine_file)


async def maps(console: Context, request: Request) -> Response:
    """All versions of the friction map."""
    arguments = console.archive.map_command("history", "--json", "-")
    return Response(await console.jobs.ask(arguments), media_type="application/json")


async def map_page(console: Context, request: Request) -> Response:
    """Draw a version of the map."""
    asked = await read_body(request, _Map)
    number = () if asked.number is None else (str(asked.number),)
    page = await run_in_threadpool(console.archive.map_page)
    await console.jobs.ask(console.archive.map_command("show", *number, "--html", str(page)))
    return JSONResponse({"page": f"/files/{page.parent.name}/{page.name}"})


async def activate(console: Context, request: Request) -> Response:
    """Put a version of the map into use."""
    asked = await read_body(request, _Map)
    return await _use_map(
        console, "activate", *(() if asked.number is None else (str(asked.number),))
    )


async def roll_back(console: Context, request: Request) -> Response:
    """Return to the map that was in use before."""
    await read_body(request, Nothing)
    return await _use_map(console, "rollback")


async def _use_map(console: Context, *arguments: str) -> Response:
    said = await console.jobs.ask(console.archive.map_command(*arguments, *_machine(console)))
    return JSONResponse({"said": said.strip()})


async def file(console: Context, request: Request) -> Response:
    """A file of a run, or the page of a map."""
    folder, name = request.path_params["folder"], request.path_params["name"]
    return await run_in_threadpool(console.archive.file, folder, name)


async def gap_file(console: Context, request: Request) -> Response:
    """A file of a diagnosis."""
    folder, name = request.path_params["folder"], request.path_params["name"]
    return await run_in_threadpool(console.archive.file, "gaps", folder, name)
