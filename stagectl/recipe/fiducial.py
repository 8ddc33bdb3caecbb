"""The marks (fiducials) of sites, which are the targets of micro-moves.

A camera is a plug-in: a callable without arguments in the entry point group `stagectl.fiducial`
that returns a `Fiducial`. Its `find` is called once the stage has settled at the site.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Protocol

from stagectl.errors import ConfigError, RunFault
from stagectl.plug_ins import load_plug_in
from stagectl.recipe.model import FiducialSource, Pair
from stagectl.recipe.schema import PluginMark

ENTRY_POINTS: Final = "stagectl.fiducial"


class Fiducial(Protocol):
    """Finds marks."""

    def find(self, site: int, position: Pair) -> Pair | None:
        """Offset of the mark from the site's nominal position [m]; None if it is not found.

        Args:
            site: number of the site, from 1.
            position: nominal position of the site [m].
        """
        ...


@dataclass(frozen=True, slots=True)
class Plugin:
    """A plug-in's fiducial; its answers must be two finite lengths, or None."""

    name: str
    inner: Fiducial

    def find(self, site: int, position: Pair) -> Pair | None:
        """The plug-in's answer.

        Raises:
            RunFault: the plug-in failed, or its answer is not an offset.
        """
        try:
            answer = self.inner.find(site, position)
        except Exception as error:
            reason = f"{type(error).__name__}: {error}".splitlines()[0]
            raise RunFault(f"fiducial plug-in '{self.name}': site {site}: {reason}") from error
        if answer is None:
            return None
        try:
            dx, dy = (float(value) for value in answer)
        except (TypeError, ValueError):
            dx = dy = math.nan
        if not (math.isfinite(dx) and math.isfinite(dy)):
            raise RunFault(
                f"fiducial plug-in '{self.name}': site {site}: the answer is not an offset [m]"
            )
        return dx, dy


def make_fiducial(source: FiducialSource, file: str = "") -> Fiducial:
    """The finder for a recipe's source of marks.

    Args:
        source: of the marks.
        file: the recipe's name, for messages.

    Raises:
        ConfigError: the plug-in is not installed or cannot be loaded.
    """
    if not isinstance(source, PluginMark):
        return source
    try:
        return Plugin(source.name, load_plug_in(ENTRY_POINTS, source.name))
    except ConfigError as error:
        raise ConfigError(f"{file}: fiducial {error}" if file else f"fiducial {error}") from error
