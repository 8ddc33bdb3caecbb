"""`stagectl completion`: completion of commands and options in a shell."""

from __future__ import annotations

import click
from click.shell_completion import get_completion_class


@click.command
@click.argument("shell", type=click.Choice(["bash", "zsh", "fish"]))
def command(shell: str) -> None:
    """Print the completion script for SHELL.

    \b
    bash:  eval "$(stagectl completion bash)"
    zsh:   eval "$(stagectl completion zsh)"
    fish:  stagectl completion fish | source
    """  # noqa: D301  (\b keeps click from wrapping what follows)
    from stagectl.cli import cli

    kind = get_completion_class(shell)
    if kind is None:
        raise click.UsageError(f"no completion for {shell}")
    click.echo(kind(cli, {}, "stagectl", "_STAGECTL_COMPLETE").source())
