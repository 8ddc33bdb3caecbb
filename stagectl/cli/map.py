"""`stagectl map`: friction maps, kept in versions."""

from __future__ import annotations

import click

from stagectl.cli.lazy import LazyGroup

COMMANDS = {
    "show": ("stagectl.cli.map_look:show", "Show a version; write it as an HTML page."),
    "activate": ("stagectl.cli.map_use:activate", "Use a version in runs, if it fits the machine."),
    "rollback": ("stagectl.cli.map_use:rollback", "Return to the version used before."),
    "history": ("stagectl.cli.map_look:list_versions", "List versions and when they were in use."),
    "compare": ("stagectl.cli.map_look:compare", "Show what changed between two versions."),
    "export": ("stagectl.cli.map_look:export", "Export a version as CSV or Parquet."),
    "build": ("stagectl.cli.map_use:build", "Build a new version from the history."),
}


@click.group(name="map", cls=LazyGroup, lazy=COMMANDS)
def command() -> None:
    """Friction as a function of table position, measured by calibrations and kept in versions.

    \b
    From measurement to use:
      stagectl calibrate SITES.yaml        # measures, and stores a new version
      stagectl map show --html map.html    # inspect it
      stagectl map activate                # all further runs use it
    """  # noqa: D301  (\b keeps click from wrapping what follows)
