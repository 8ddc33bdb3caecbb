"""Who is told how a run proceeds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from drivers.cyclic import Sink
from hil_sim.bus import World
from hil_sim.stage import VirtualStage
from stagectl.sequencer import Event, PauseRequest


@dataclass(slots=True)
class Listener:
    """Callbacks of a run.

    Attributes:
        phase: called with a few words when a phase begins (boot, home, ...).
        event: called with each event of the engine.
        stoppable: called with the function that requests a controlled stop.
        switched_on: called with the virtual stage and its world (with `--simulate`).
        sample: called with each sample in the thread that sends SYNC, or None.
        pause: asked between sites whether the run is to pause.
    """

    phase: Callable[[str], object] = field(default=lambda _: None)
    event: Callable[[Event], object] = field(default=lambda _: None)
    stoppable: Callable[[Callable[[str], None]], object] = field(default=lambda _: None)
    switched_on: Callable[[VirtualStage, World], object] = field(default=lambda *_: None)
    sample: Sink | None = None
    pause: PauseRequest = field(default_factory=lambda: PauseRequest())
