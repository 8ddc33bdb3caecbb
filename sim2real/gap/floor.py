"""The floor under the gap: what even a perfect model would leave against a recording.

It is the rms difference, per axis and signal, between noisy runs of the model (encoder noise,
friction wander by the machine file's `repeatability`, the resolution of the log) and its noise-free
run, averaged over a few draws. Where the recording repeats moves, the floor is checked against the
scatter between repetitions, an independent estimate. Definitions: docs/formats/gap-report.md.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hil_sim.settings import StageSettings
from sim2real.gap.replay import Replay, Signals, rms, subtract_signals
from sim2real.phases import group_repeated_moves, split_moves
from stagedata import FloatArray, Recording

DRAWS = 4
_SEED = 1
PERFECT_MODEL = "A perfect model leaves 0.4 to 2.1 times the floor, from run to run."
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


def estimate_floor(
    replay: Replay,
    settings: StageSettings,
    draws: int = DRAWS,
    progress: Callable[[int, int], object] | None = None,
) -> Floor:
    """The floor of a model over a recording's demands.

    Args:
        replay: of the recording.
        settings: of the model.
        draws: number of noisy draws, at least one.
        progress: called with (simulations done, all simulations).
    """

    def run(done: int, seed: int | None) -> Signals:
        signals = replay.run(settings, seed)
        if seed is not None:
            signals = replay.as_logged(signals)
        if progress is not None:
            progress(done, draws + 1)
        return signals

    nominal = run(1, None)
    noisy = tuple(subtract_signals(run(2 + i, _SEED + i), nominal) for i in range(draws))
    return Floor(
        nominal,
        noisy,
        {
            name: {
                signal: float(
                    np.mean([rms(draw[name][signal], replay.valid(name)) for draw in noisy])
                )
                for signal in signals
            }
            for name, signals in nominal.items()
        },
    )


def check_repeats(
    recording: Recording, period: float, gap: Signals, draws: tuple[Signals, ...]
) -> dict[str, dict[str, RepeatCheck]]:
    """Scatter between repeated moves, of the recording and of the model's noisy draws.

    The model's prediction is subtracted first, so that repetitions which start from another
    friction state do not count as scatter.

    Args:
        recording: with moves that repeat one another.
        period: of the samples [s].
        gap: recorded minus simulated.
        draws: noisy minus noise-free runs of the model.

    Returns:
        Axis -> signal -> check; empty where no move repeats another.
    """
    found = split_moves(recording, period)
    groups = group_repeated_moves(recording, found)
    if not groups:
        return {}
    lengths = [min(found[i].stop - found[i].moving for i in group) for group in groups]
    cuts = [
        np.array([np.arange(found[i].moving, found[i].moving + length) for i in group])
        for group, length in zip(groups, lengths, strict=True)
    ]

    def scatter(values: FloatArray) -> float:
        energy = samples = 0.0
        for cut in cuts:
            each = values[cut]
            energy += float(np.square(each - each.mean(axis=0)).sum())
            samples += each.size - each.shape[1]
        return float(np.sqrt(energy / samples))

    moves = sum(len(group) for group in groups)
    return {
        name: {
            signal: RepeatCheck(
                scatter(values),
                float(np.mean([scatter(draw[name][signal]) for draw in draws])),
                moves,
            )
            for signal, values in signals.items()
        }
        for name, signals in gap.items()
    }
