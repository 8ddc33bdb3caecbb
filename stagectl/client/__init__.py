"""Clients of a stage server, for scripts, the command line and the console.

`Client` waits for its answers, `AsyncClient` is the same for asyncio. Both raise `Refused` for what
the server refuses and `NoServer` where none answers. `find_server` says whether one serves a bus.
"""

from stagectl.client.asynchronous import AsyncClient
from stagectl.client.base import JobFailed, NoServer, Refused
from stagectl.client.finding import find_server, server_names
from stagectl.client.synchronous import Client

__all__ = [
    "AsyncClient", "Client", "JobFailed", "NoServer", "Refused", "find_server", "server_names"
]  # fmt: skip
