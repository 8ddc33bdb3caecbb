"""A command group that imports a command only when it is called."""

from __future__ import annotations

from collections.abc import Mapping
from difflib import get_close_matches
from importlib import import_module
from typing import Any

import click

from stagectl.cli.files import guarded


class LazyGroup(click.Group):
    """A group that imports its commands on demand.

    Args:
        lazy: command -> (module or module:attribute, attribute `command` by default; one-line
            help), in the order in which they are listed.
    """

    def __init__(self, *args: Any, lazy: Mapping[str, tuple[str, str]], **keywords: Any) -> None:
        super().__init__(*args, **keywords)
        self._lazy = lazy

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Refuse control characters: names from the command line are printed, and go into files."""
        from stagectl.plain_text import find_control

        for number, text in enumerate(args, 1):
            if (reason := find_control(text)) is not None:  # not shown: it may be a password
                raise click.UsageError(f"argument {number} {reason}", ctx)
        return super().parse_args(ctx, args)

    def list_commands(self, ctx: click.Context) -> list[str]:
        """All commands, in the order given."""
        return list(self._lazy)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import the command; its outputs are checked before it starts."""
        if cmd_name not in self._lazy:
            near = get_close_matches(cmd_name, self._lazy, 1)
            if near and not ctx.resilient_parsing:
                ctx.fail(f"no such command '{cmd_name}'; did you mean '{near[0]}'?")
            return None
        module, _, attribute = self._lazy[cmd_name][0].partition(":")
        command: click.Command = getattr(import_module(module), attribute or "command")
        return guarded(command)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands without importing them."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, text) for name, (_, text) in self._lazy.items()])
