"""The floor under the gap: what even a perfect model would leave against a recording.

It is the rms difference, per axis and signal, between noisy runs of the model (encoder noise,
friction wander by the machine file's `repeatability`, the resolution of the log) and its noise-free
run, averaged over a few draws. Where the recording repeats moves, the floor is checked against the
scatter between repetitions, an independent estimate. Definitions: docs/formats/gap-report.md.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hil_sim.settings import StageSettings
from sim2real.gap.replay import Replay, Signals, subtract_signals
from sim2real.phases import group_repeated_moves, split_moves
from stagedata import FloatArray

DRAWS = 4
_SEED = 1
LARGEST_OF_PERFECT = 2.1
PERFECT_MODEL = (
    f"A perfect model leaves 0.4 to {LARGEST_OF_PERFECT} times the floor, from run to run."
)
"""For whoever compares a gap with its floor, which is that of an average run: figures.md."""


@dataclass(frozen=True, slots=True)
class RepeatCheck:
    """The floor against repeated moves, for one signal of one axis.

    Attributes:
        repeated: rms scatter between repetitions, times sqrt(n/(n-1)) [m or N].
        floor: the model's own scatter over the same samples, computed alike [m or N].
        moves: number of moves that repeat another.
    """

    repeated: float
    floor: float
    moves: int

    @property
    def ratio(self) -> float:
        """Measured scatter over the floor; near 1 where the machine file's repeatability holds."""
        return self.repeated / self.floor if self.floor > 0 else float("inf")


@dataclass(frozen=True, slots=True, eq=False)
class Floor:
    """Floor of a model against a recording.

    Attributes:
        nominal: the model's noise-free signals.
        draws: its noisy signals minus those, one entry per draw.
        rms: axis -> signal -> floor [m, N].
    """

    nominal: Signals
    draws: tuple[Signals, ...]
    rms: dict[str, dict[str, float]]


class ModelRuns:
    """The noise-free run of a model and its noisy draws, along the blocks of a recording.

    Args:
        replay: of the first block.
        settings: of the model.
        draws: number of noisy draws, at least one.
    """

    def __init__(self, replay: Replay, settings: StageSettings, draws: int) -> None:
        self._nominal = replay.simulation(settings, None)
        self._noisy = [replay.simulation(settings, _SEED + i) for i in range(draws)]

    def along(
        self, replay: Replay, progress: Callable[[], object]
    ) -> tuple[Signals, tuple[Signals, ...]]:
        """The noise-free signals along the next block, and each draw's noisy ones minus those.

        Args:
            replay: of the block.
            progress: called after each run.
        """
        nominal = replay.go_on(self._nominal)
        progress()
        noisy = []
        for draw in self._noisy:
            logged = replay.as_logged(replay.go_on(draw))
            noisy.append(subtract_signals(logged, nominal))
            progress()
        return nominal, tuple(noisy)


class MeanSquares:
    """Mean squares of a residual and of the model's noisy draws, added up block by block."""

    def __init__(self) -> None:
        self._sums: dict[tuple[str, str], tuple[FloatArray, float]] = {}

    def add(self, axis: str, signal: str, energy: Sequence[float], samples: float) -> None:
        """Add sums of squares over this number of samples: of the residual, then of each draw."""
        before, counted = self._sums.get((axis, signal), (np.zeros(len(energy)), 0.0))
        self._sums[axis, signal] = before + energy, counted + samples

    def rms(self, axis: str, signal: str) -> tuple[float, float]:
        """Root mean square of the residual, and that of a draw, averaged over the draws [m or N].

        Infinite where it overflows.
        """
        energy, samples = self._sums[axis, signal]
        roots = np.sqrt(energy / samples)
        return float(roots[0]), float(np.mean(roots[1:]))


class RepeatScatter:
    """Scatter between repeated moves, of a recording and of the model's noisy draws.

    The model's prediction is subtracted first, so that repetitions which start from another
    friction state do not count as scatter. Moves are compared within a block.
    """

    def __init__(self) -> None:
        self._squares = MeanSquares()
        self._moves = 0

    def add(self, replay: Replay, residual: Signals, draws: tuple[Signals, ...]) -> None:
        """Add a block.

        Args:
            replay: of the block.
            residual: recorded minus simulated.
            draws: noisy minus noise-free runs of the model.
        """
        found = split_moves(replay.recording, replay.period)
        groups = group_repeated_moves(replay.recording, found)
        self._moves += sum(len(group) for group in groups)
        lengths = [min(found[i].stop - found[i].moving for i in group) for group in groups]
        cuts = [
            np.array([np.arange(found[i].moving, found[i].moving + length) for i in group])
            for group, length in zip(groups, lengths, strict=True)
        ]
        samples = float(sum(cut.size - cut.shape[1] for cut in cuts))

        def energy(values: FloatArray) -> float:
            each = [values[cut] for cut in cuts]
            return sum(float(np.square(e - e.mean(axis=0)).sum()) for e in each)

        if not groups:
            return
        for name, signals in residual.items():
            for signal, values in signals.items():
                every = (values, *(draw[name][signal] for draw in draws))
                self._squares.add(name, signal, [energy(v) for v in every], samples)

    def checks(self, signals: Mapping[str, Iterable[str]]) -> dict[str, dict[str, RepeatCheck]]:
        """Axis -> signal -> check; empty where no move repeats another.

        Args:
            signals: axis -> names of its signals.
        """
        if not self._moves:
            return {}
        return {
            axis: {name: RepeatCheck(*self._squares.rms(axis, name), self._moves) for name in names}
            for axis, names in signals.items()
        }
