"""The rich console of all commands: it prints every text as it is."""

from __future__ import annotations

import os
from contextlib import suppress
from typing import Any

from rich.console import Console


class PlainConsole(Console):
    """Prints every text as it is: names from files are no markup.

    What is to have a style is a `rich.text.Text`.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(markup=False, emoji=False, **options)

    def on_broken_pipe(self) -> None:
        """Nobody reads this stream any more: it goes nowhere from now on.

        Rich would take that of standard output, whichever stream it was: the JSON there was lost.

        Raises:
            SystemExit: always.
        """
        self.quiet = True
        with suppress(OSError, ValueError):  # no file, or closed
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self.file.fileno())
            os.close(nowhere)
        raise SystemExit(1)
