"""The marks (fiducials) of sites, which are the targets of micro-moves.

A camera is a plug-in: a callable without arguments in the entry point group `stagectl.fiducial`
that returns a `Fiducial`. Its `find` is called once the stage has settled at the site.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from importlib import metadata
from typing import Final, Protocol

from stagectl.errors import ConfigError, RunFault
from stagectl.recipe.model import FiducialSource, ListedMarks, Pair
from stagectl.recipe.schema import NoMark, PluginMark, SimulatedMark

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
class Simulated:
    """Marks drawn uniformly within +-`range` [m] per axis, in whole nm, from seed and site."""

    range: float
    seed: int

    def find(self, site: int, position: Pair) -> Pair | None:
        """The offset of the site's mark, always the same for a site."""
        import numpy as np

        dx, dy = np.random.default_rng((self.seed, site)).uniform(-self.range, self.range, 2)
        return round(float(dx), 9), round(float(dy), 9)


@dataclass(frozen=True, slots=True)
class Offsets:
    """Known offsets [m] by site."""

    offsets: dict[int, Pair]

    def find(self, site: int, position: Pair) -> Pair | None:
        """The offset listed for the site; None if there is none."""
        return self.offsets.get(site)


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
    match source:
        case SimulatedMark():
            return Simulated(source.range, source.seed)
        case ListedMarks():
            return Offsets(source.offsets)
        case PluginMark():
            return _plugin(source.name, f"{file}: " if file else "")
        case NoMark():
            return Offsets({})


def _plugin(name: str, where: str) -> Plugin:
    found = list(metadata.entry_points(group=ENTRY_POINTS, name=name))
    if not found:
        raise ConfigError(f"{where}fiducial plug-in '{name}' is not installed")
    try:
        return Plugin(name, found[0].load()())
    except Exception as error:
        reason = f"{type(error).__name__}: {error}".splitlines()[0]
        raise ConfigError(f"{where}fiducial plug-in '{name}' cannot be loaded: {reason}") from error
