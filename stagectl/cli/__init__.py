"""The command line; each command is imported only when it is called.

Exit codes: 0 done, 1 other failure, 2 unusable input, 3 fault of the stage, 130 stopped by the
operator. Messages are one line and go to standard error.
"""

from __future__ import annotations

import sys
from io import TextIOWrapper

import click

from stagectl.cli.lazy import LazyGroup

COMMANDS = {
    "run": ("stagectl.cli.run", "Run a recipe on the stage, or on its simulation."),
    "sim": ("stagectl.cli.sim", "Virtual drives in real time on a CAN bus."),
    "scan": ("stagectl.cli.scan", "Who is on the bus."),
    "status": ("stagectl.cli.status", "What the axes are doing."),
    "enable": ("stagectl.cli.bench:enable", "Close the loops and hold the stage."),
    "home": ("stagectl.cli.bench:home", "Home all axes."),
    "jog": ("stagectl.cli.bench:jog", "Move one axis by a distance."),
    "check": ("stagectl.cli.check", "Does a drive behave as CiA 402 says?"),
    "bus-budget": ("stagectl.cli.bus_budget", "Does the PDO set fit the bus?"),
    "gap": ("stagectl.cli.gap", "Where simulation and recording differ."),
    "effects": ("stagectl.cli.effects", "Physical effects that a machine file can switch on."),
    "identify": ("stagectl.cli.identify", "Friction figures out of recordings."),
    "map": ("stagectl.cli.map", "Friction over the table, in versions."),
    "history": ("stagectl.cli.history", "The friction history: file what is missing."),
    "calibrate": ("stagectl.cli.calibrate", "Friction measured at fixed sites."),
    "paper": ("stagectl.cli.paper", "The source paper's tables and claims, reproduced."),
    "recover": ("stagectl.cli.recover", "Recordings out of what killed runs left."),
    "replay": ("stagectl.cli.replay", "A recorded bus log drives the host again."),
    "completion": ("stagectl.cli.completion", "Shell completion."),
}


@click.group(cls=LazyGroup, lazy=COMMANDS, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="stagectl")
def cli() -> None:
    """Two-axis direct-drive inspection stages on CANopen: run, simulate, compare.

    \b
    Try it without hardware:
      stagectl run recipes/inspection-20.yaml --simulate
    \b
    See what a recipe would do:
      stagectl run recipes/inspection-20.yaml --dry-run

    Every command has its own --help. Units are SI throughout.
    """  # noqa: D301  (\b keeps click from wrapping what follows)


def main() -> None:
    """Entry point of the `stagectl` command."""
    from stagectl.errors import StagectlError
    from stagectl.kernel_cache import drop_stale

    drop_stale()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")  # a µ that a terminal cannot show is no failure
    try:
        # where click is not the program, an exit code that a command asks for comes back
        if code := cli.main(standalone_mode=False):
            sys.exit(code)
    except click.exceptions.Abort:
        click.echo("stagectl: stopped", err=True)
        sys.exit(130)
    except click.exceptions.NoArgsIsHelpError as problem:
        problem.show()
        sys.exit(problem.exit_code)
    except click.ClickException as problem:
        context = getattr(problem, "ctx", None)
        hint = f" (see '{context.command_path} --help')" if context is not None else ""
        click.echo(f"stagectl: {' '.join(problem.format_message().split())}{hint}", err=True)
        sys.exit(problem.exit_code)
    except StagectlError as problem:
        for line in str(problem).splitlines() or [type(problem).__name__]:
            click.echo(f"stagectl: {line}", err=True)
        sys.exit(problem.exit_code)
    except BrokenPipeError:
        sys.exit(1)
    except OSError as problem:
        where = f"{problem.filename}: " if problem.filename else ""
        click.echo(f"stagectl: {where}{problem.strerror or problem}", err=True)
        sys.exit(1)
