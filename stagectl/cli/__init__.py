"""The command line. Each command is imported only when it is called.

Exit codes: 0 success, 1 other failure, 2 unusable input (a file or folder that cannot
be written included), 3 fault of the stage, 4 a complete run
that misses the recipe's limits, 130 stopped by the operator. Error messages are one line each,
without control characters, and go to standard error.
"""

from __future__ import annotations

import sys
from io import TextIOWrapper

import click

from stagectl.cli.lazy import LazyGroup

COMMANDS = {
    "run": ("stagectl.cli.run", "Run a recipe on the stage or on its simulation."),
    "serve": ("stagectl.cli.serve", "Own the stage and serve clients."),
    "sim": ("stagectl.cli.sim", "Serve virtual drives on a CAN bus in real time."),
    "console": ("stagectl.cli.console", "Serve the operator's web page."),
    "scan": ("stagectl.cli.scan", "List the nodes on the bus."),
    "status": ("stagectl.cli.status", "Show state, position, force and errors of the axes."),
    "enable": ("stagectl.cli.bench:enable", "Enable the drives and hold the stage in place."),
    "home": ("stagectl.cli.bench:home", "Home all axes."),
    "jog": ("stagectl.cli.bench:jog", "Move one axis by a distance."),
    "sdo": ("stagectl.cli.sdo", "Read and write objects of a drive."),
    "monitor": ("stagectl.cli.monitor", "Show the frames on the bus in words."),
    "check": ("stagectl.cli.check", "Test a drive against CiA 301 and CiA 402."),
    "bus-budget": ("stagectl.cli.bus_budget", "Check that the PDOs fit into the SYNC period."),
    "observer": ("stagectl.cli.observer", "Show gain and margins of the settling observer."),
    "gap": ("stagectl.cli.gap", "Compare simulation and recording, and explain the gap."),
    "fleet": ("stagectl.cli.fleet", "Diagnose many recordings, and say what they have in common."),
    "effects": ("stagectl.cli.effects", "List the physical effects of the simulator."),
    "identify": ("stagectl.cli.identify", "Estimate friction parameters from recordings."),
    "map": ("stagectl.cli.map", "Show, activate and compare friction maps."),
    "history": ("stagectl.cli.history", "List and import runs of the friction history."),
    "calibrate": ("stagectl.cli.calibrate", "Measure friction at fixed sites and build a map."),
    "paper": ("stagectl.cli.paper", "Reproduce the source paper's tables and claims."),
    "runs": ("stagectl.cli.runs", "List runs with recipe, time, lot, wafer, operator and outcome."),
    "report": ("stagectl.cli.report", "Make summary and report of a run again."),
    "recover": ("stagectl.cli.recover", "Recover the recording of a killed run."),
    "replay": ("stagectl.cli.replay", "Rerun the host on a recorded bus log."),
    "doctor": ("stagectl.cli.doctor", "Report what this machine offers a stage and what it lacks."),
    "completion": ("stagectl.cli.completion", "Print a shell completion script."),
}


_SETTINGS = {"help_option_names": ["-h", "--help"], "show_default": True}
_LONGEST = 4000
"""Characters of an error message that are shown."""


@click.group(cls=LazyGroup, lazy=COMMANDS, context_settings=_SETTINGS)
@click.version_option(package_name="stagectl")
def cli() -> None:
    """Run, simulate and calibrate two-axis direct-drive inspection stages on CANopen.

    \b
    Try it without hardware:
      stagectl run recipes/inspection-20.yaml --simulate
    \b
    See what a recipe would do:
      stagectl run recipes/inspection-20.yaml --dry-run

    Every command has its own --help. All quantities are in SI units. An output replaces a file of
    another kind only with --overwrite, and never an input.
    """  # noqa: D301  (\b keeps click from wrapping what follows)


def main() -> None:
    """Entry point of the `stagectl` command."""
    from stagectl.errors import StagectlError, failure_to_write
    from stagectl.plain_text import one_line

    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")  # the terminal may lack a character such as µ
    try:
        # not in standalone mode, click returns the exit code that a command asked for
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
        text = one_line(" ".join(problem.format_message().split()), _LONGEST)
        click.echo(f"stagectl: {text}{hint}", err=True)
        sys.exit(problem.exit_code)
    except StagectlError as problem:
        for line in str(problem).splitlines() or [type(problem).__name__]:
            click.echo(f"stagectl: {one_line(line, _LONGEST)}", err=True)
        sys.exit(problem.exit_code)
    except BrokenPipeError:
        sys.exit(1)
    except OSError as problem:
        failure = failure_to_write(str(problem.filename or "system"), problem)
        click.echo(f"stagectl: {one_line(failure, _LONGEST)}", err=True)
        sys.exit(failure.exit_code)
