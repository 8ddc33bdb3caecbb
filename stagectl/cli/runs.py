"""`stagectl runs`: the runs in a folder, listed or compared."""

from __future__ import annotations

import click

from stagectl.cli.lazy import LazyGroup

COMMANDS = {
    "list": ("stagectl.cli.runs_list", "List the runs in a folder; what `runs FOLDER` does, too."),
    "compare": ("stagectl.cli.runs_compare:compare", "Two runs beside each other."),
}


class _RunsGroup(LazyGroup):
    """Lists where no command is named."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        if not args or args[0] not in (*COMMANDS, "--help"):
            args = ["list", *args]
        return super().parse_args(ctx, args)


@click.group(cls=_RunsGroup, lazy=COMMANDS)
def command() -> None:
    """List the runs in a folder, or compare two.

    \b
    What has been run, and how did it end?
      stagectl runs [FOLDER]
    How do two wafers differ?
      stagectl runs compare runs/A runs/B
    """  # noqa: D301  (\b keeps click from wrapping what follows)
