"""How a run gets the stage: one of its own, or one that is kept ready between runs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from typing import ParamSpec, Protocol

import can
import numpy as np

from drivers import Stage
from drivers.canopen import Tap
from drivers.settings import AxisSettings, BusSettings
from stagectl.errors import Aborted

P = ParamSpec("P")
RAMP, REST = 0.05, 0.3
"""Duration of the ramp of force offsets to 0, and of the rest after it [s]."""

Steps = Sequence[tuple[str, Callable[[], object]]]
"""What to do, in order, each with a few words."""


class StageAccess(Protocol):
    """The stage, for the time of a run.

    Attributes:
        held: it was ready before the run, whose bus log lacks how it became so.
    """

    held: bool

    def stage(self, tap: Tap) -> AbstractContextManager[Stage]:
        """The stage, whose frames go to `tap` as well."""

    def boot(self, stage: Stage) -> Steps:
        """Up to where the drives have answered."""

    def make_ready(self, stage: Stage) -> Steps:
        """From there to the enabled stage."""

    def leave(self, stage: Stage, announce: Callable[[str], object]) -> None:
        """After the run."""


class OwnStage:
    """A stage that is opened, homed and enabled for the run, and disabled after it.

    Args:
        bus, axes: settings.
        opened: that bus; it stays open.
    """

    held = False

    def __init__(self, bus: BusSettings, axes: Sequence[AxisSettings], opened: can.BusABC) -> None:
        self._bus, self._axes, self._opened = bus, axes, opened

    def stage(self, tap: Tap) -> AbstractContextManager[Stage]:
        """The stage, closed at the end."""
        return Stage.open(self._bus, self._axes, tap=tap, bus_object=self._opened)

    def boot(self, stage: Stage) -> Steps:
        """Boot the drives."""
        return [("booting the drives", stage.boot)]

    def make_ready(self, stage: Stage) -> Steps:
        """Home and enable the axes."""
        return [("homing", stage.home), ("enabling the drives", stage.enable)]

    def leave(self, stage: Stage, announce: Callable[[str], object]) -> None:
        """Switch the power off."""
        announce("disabling")
        stage.disable()


class HeldStage:
    """A booted stage that stays open, and held where the run ends in order.

    Args:
        stage: booted.
    """

    held = True

    def __init__(self, stage: Stage) -> None:
        self._stage = stage

    @contextmanager
    def stage(self, tap: Tap) -> Iterator[Stage]:
        """The stage; an end that the operator asked for leaves it held, any other stops it."""
        stage, before = self._stage, (self._stage.sink, self._stage.tap)
        stage.tap = tap if before[1] is None else both(tap, before[1])
        try:
            yield stage
        except Aborted:
            raise
        except BaseException:
            if stage.enabled:
                stage.safe_stop()
            raise
        finally:
            stage.sink, stage.tap = before
            stage.correct_offsets(None)

    def boot(self, stage: Stage) -> Steps:
        """Nothing: it is booted."""
        return []

    def make_ready(self, stage: Stage) -> Steps:
        """Home axes that have lost their zero, and enable those that are not."""
        homing: Steps = [] if stage.homed else [("homing", stage.home)]
        ready = [
            ("enabling the drives", stage.enable),
            ("holding", lambda: _take_offsets_out(stage)),
        ]
        return [*homing, *ready]

    def leave(self, stage: Stage, announce: Callable[[str], object]) -> None:
        """Nothing: the axes stay held."""


def both(first: Callable[P, object], second: Callable[P, object]) -> Callable[P, None]:
    """Calls one after the other, such as taps of frames or sinks of samples."""

    def call(*arguments: P.args, **keywords: P.kwargs) -> None:
        first(*arguments, **keywords)
        second(*arguments, **keywords)

    return call


def _take_offsets_out(stage: Stage) -> None:
    """Ramp what the last run has left of force offsets to 0, and come to rest: a run begins so."""
    if not any(stage.offsets):
        return
    period = stage.settings.sync_period
    fall = np.linspace(1.0, 0.0, max(2, round(RAMP / period)))
    offsets = np.concatenate([fall, np.zeros(round(REST / period))])[:, None] * stage.offsets
    stage.stream(np.tile(stage.targets, (len(offsets), 1)), offsets)
