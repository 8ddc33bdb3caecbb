"""A stage that follows its setpoints at once."""

from dataclasses import replace

import numpy as np

from stagedata import Samples

TS = 1e-3


class Echo:
    """A stage that follows at once; it skips periods at `skip`, and its SYNC is late at `late`.

    Samples arrive 0.2 ms after their SYNC, those of `straggling` 15 us later.
    """

    streams = True

    targets = (0.0,)

    def __init__(self, skip=(), late=(), straggling=()):
        self.k, self.periods, self.skip, self.late = 0, 0, skip, late
        self.offsets = []
        self.straggling = straggling

    def stream(self, position, offset, until=None):
        time, late, rows, arrival = [], [], [], []
        for row in position:
            if self.k in self.skip:
                self.periods += 2
            time.append(self.periods * TS)
            late.append(self.k in self.late)
            arrival.append([2e-4 + 1.5e-5 * (self.k in self.straggling)])
            rows.append(row)
            self.k += 1
            self.periods += 1
            if until is not None and until(tuple(row)):
                break
        count = len(rows)
        self.offsets.append(offset[:count])
        axes = len(self.targets)
        return replace(
            Samples.missing(count, axes),
            position=np.array(rows),
            force=np.full((count, axes), 1.5),
            valid=np.ones((count, axes), dtype=bool),
            time=np.array(time),
            late=np.array(late),
            arrival=np.repeat(arrival, axes, axis=1),
            doubt=np.full(count, np.inf),
        )


class Stuck(Echo):
    """Reports positions 2 mm off its setpoints, from sample 60 on."""

    def stream(self, position, offset, until=None):
        before = self.k
        block = super().stream(position, offset, until)
        block.position[max(0, 60 - before) :] += 2e-3
        return block
