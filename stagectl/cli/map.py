"""`stagectl map`: friction over the table, in versions."""

from __future__ import annotations

import click

from stagectl.cli.lazy import LazyGroup

COMMANDS = {
    "show": ("stagectl.cli.map_look:show", "A version: its figures, sites, and an HTML page."),
    "activate": ("stagectl.cli.map_use:activate", "Put a version into use, if it fits."),
    "rollback": ("stagectl.cli.map_use:rollback", "Back to the version that was in use before."),
    "history": ("stagectl.cli.map_look:list_versions", "All versions, and when which was in use."),
    "compare": ("stagectl.cli.map_look:compare", "What has changed from one version to another."),
    "export": ("stagectl.cli.map_look:export", "A version as CSV or Parquet."),
    "build": ("stagectl.cli.map_use:build", "Make a new version out of the history."),
}


@click.group(name="map", cls=LazyGroup, lazy=COMMANDS)
def command() -> None:
    """Friction over the table: built from calibrations, kept in versions, used when activated.

    \b
    A map comes about and into use like this:
      stagectl calibrate SITES.yaml        # measures, and keeps a new version
      stagectl map show --html map.html    # look at it
      stagectl map activate                # runs go by it from now on
    """  # noqa: D301
