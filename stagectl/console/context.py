"""What the console's routes work with."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from stagectl.console.access import Access
from stagectl.console.archive import Archive
from stagectl.console.gate import Addresses, Gate
from stagectl.console.jobs import Jobs
from stagectl.console.link import StageLink
from stagectl.console.recipes import Recipes
from stagectl.console.server_process import ServerProcess


@dataclass
class Context:
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
