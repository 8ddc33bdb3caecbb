"""The data folder: its runs, the diagnoses and map pages that the console has had made in it.

Reports are documents of strangers: in a sandbox, with no scripts but this program's own. A report
carries its scripts inside. Those that this version puts into its pages are allowed by their hashes;
any other, such as one that a file name has smuggled in, does not run.
"""

from __future__ import annotations

import base64
import hashlib
import os
from collections.abc import Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import Any, BinaryIO
from urllib.parse import quote

from starlette.concurrency import run_in_threadpool
from starlette.responses import Response
from starlette.types import Receive, Scope, Send

from stagectl.console.folder import NoSuchFile, is_name, open_inside
from stagectl.errors import UnusableInput
from stagectl.protocol.requests import MOST_RECIPE, MachineFile

GAPS, MAPS = "gaps", "maps"
TWIN, RECORDING = "twin.yaml", "recording.h5"
_BLOCK = 1 << 18
_KINDS = {
    ".html": "text/html; charset=utf-8", ".json": "application/json", ".h5": "application/x-hdf5",
    ".yaml": "text/plain; charset=utf-8", ".csv": "text/csv", ".asc": "text/plain",
}  # fmt: skip
_STATIC = Path(__file__).parents[1] / "report" / "static"
_INLINE = "page.start(() => {});"
"""The script of pages that have none of their own (templates/page.html.j2)."""


class OpenFile(Response):
    """A response with the content of an open file, closed at its end whatever the client does."""

    def __init__(self, file: BinaryIO, headers: dict[str, str], kind: str) -> None:
        super().__init__(None, headers=headers, media_type=kind)
        self._file = file

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send it."""
        with self._file as file:
            start = {"type": "http.response.start", "status": 200, "headers": self.raw_headers}
            await send(start)
            while block := await run_in_threadpool(file.read, _BLOCK):
                await send({"type": "http.response.body", "body": block, "more_body": True})
            await send({"type": "http.response.body", "body": b"", "more_body": False})


class Archive:
    """One data folder.

    Args:
        folder: trusted: the server's, or named on the command line.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def runs(self) -> list[dict[str, Any]]:
        """All runs, the latest first, with the names of their pages."""
        from stagectl.run import list_runs

        if not self._folder.is_dir():
            return []
        listed = []
        for run in reversed(list_runs(self._folder)):
            if run.folder.is_symlink() or not is_name(run.folder.name):
                continue
            pages = sorted(path.name for path in run.folder.glob("*.html"))
            has_recording = (run.folder / RECORDING).is_file()
            listed.append(
                {
                    **asdict(run),
                    "folder": run.folder.name,
                    "pages": pages,
                    "recorded": has_recording,
                }
            )
        return listed

    def gaps(self) -> list[dict[str, Any]]:
        """All diagnoses, the latest first, with the names of their files."""
        folder = self._folder / GAPS
        if not folder.is_dir():
            return []
        return [
            {"folder": path.name, "files": sorted(file.name for file in path.iterdir())}
            for path in sorted(folder.iterdir(), reverse=True)
            if is_name(path.name) and path.is_dir() and not path.is_symlink()
        ]

    def diagnosis(self, runs: Sequence[str]) -> tuple[Path, list[str]]:
        """The folder for a diagnosis of some runs, made, and the command.

        Raises:
            NoSuchFile: a run has no recording here.
        """
        for run in runs:
            open_inside(self._folder, run, RECORDING).close()
        recordings = [str(self._folder / run / RECORDING) for run in runs]
        folder = self._made(GAPS) / f"{runs[0]}-{datetime.now(UTC):%Y%m%d-%H%M%S}"
        folder.mkdir()
        return folder, [
            "gap", "diagnose", *recordings, "--jobs", "1", "--html", str(folder / "report.html"),
            "--json", str(folder / "diagnosis.json"), "--twin", str(folder / TWIN),
        ]  # fmt: skip

    def twin(self, diagnosis: str) -> MachineFile:
        """The machine file that a diagnosis has written.

        Raises:
            NoSuchFile: it has written none.
        """
        with open_inside(self._folder, GAPS, diagnosis, TWIN) as file:
            data = file.read(MOST_RECIPE + 1)
        if len(data) > MOST_RECIPE:
            raise NoSuchFile(f"{diagnosis}: its twin is larger than a machine file can be")
        source = (self._folder / GAPS / diagnosis / TWIN).absolute()
        return MachineFile(text=data.decode("utf-8"), source=str(source))

    def compare_command(self, before: str, after: str) -> list[str]:
        """`stagectl gap compare` of two runs.

        Raises:
            NoSuchFile: one has no recording here.
        """
        for run in (before, after):
            open_inside(self._folder, run, RECORDING).close()
        recordings = [str(self._folder / run / RECORDING) for run in (before, after)]
        return ["gap", "compare", *recordings, "--json", "-"]

    def map_page(self) -> Path:
        """Where the page of a map is written."""
        return self._made(MAPS) / "map.html"

    def map_command(self, *arguments: str) -> list[str]:
        """`stagectl map` on the history of the data folder."""
        return ["map", *arguments, "--history", str(self._folder / "stage.db")]

    def calibrate_command(self, sites: Path, *arguments: str) -> list[str]:
        """`stagectl calibrate` into the data folder and its history."""
        folder = self._folder / f"{sites.stem}-{datetime.now(UTC):%Y%m%d-%H%M%S}"
        history = str(self._folder / "stage.db")
        return ["calibrate", str(sites), "--history", history, "--out", str(folder), *arguments]

    def file(self, *parts: str) -> Response:
        """A file to look at or to save.

        Raises:
            NoSuchFile: not in the folder, or not of a kind that is served.
        """
        kind = _KINDS.get(Path(parts[-1]).suffix)
        if kind is None:
            raise NoSuchFile(f"{parts[-1][:100]}: not a kind of file that is served")
        file = open_inside(self._folder, *parts)
        headers = {"content-length": str(os.fstat(file.fileno()).st_size)}
        if kind.startswith("text/html"):
            headers["content-security-policy"] = report_policy()
        else:
            headers["content-disposition"] = f"attachment; filename*=UTF-8''{quote(parts[-1])}"
        return OpenFile(file, headers, kind)

    def _made(self, name: str) -> Path:
        folder = self._folder / name
        if folder.is_symlink():
            raise UnusableInput(f"{folder}: is a link")
        folder.mkdir(exist_ok=True)
        return folder


@cache
def report_policy() -> str:
    """The content policy of reports: an origin of their own, no network, known scripts only."""
    scripts = [path.read_bytes() for path in sorted(_STATIC.glob("*.js"))]
    hashes = " ".join(_hash(script) for script in [*scripts, _INLINE.encode()])
    return (
        f"sandbox allow-scripts allow-downloads; default-src 'none'; script-src {hashes}; "
        "style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'; "
        "frame-ancestors 'none'"
    )


def _hash(script: bytes) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(script).digest()).decode()}'"
