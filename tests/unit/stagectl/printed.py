"""What a terminal shows."""

import io

from rich.console import Console


def printed(part, width=120):
    console = Console(width=width, file=io.StringIO(), record=True)
    console.print(part, crop=False)
    return console.export_text()
