"""Detects steps of a level: Page's two-sided cumulative sum of standardised innovations.

S+ <- max(0, S+ + z - k), S- <- max(0, S- - z - k); an alarm where one passes h (E. S. Page,
Biometrika 41, 1954). z is what a tracker did not expect over what it thought possible: standard
normal while nothing steps, drift being the tracker's business. With k = 1.25 and h = 3.9 there is a
false alarm in 50,000 normal z (Siegmund's approximation below). A single z of 5.2 is enough by
itself, and a step of 4 standard deviations takes two or three.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

ALLOWANCE = 1.25
THRESHOLD = 3.9


@dataclass(slots=True)
class StepDetector:
    """The sums of one level.

    Attributes:
        up, down: the sums.
    """

    up: float = 0.0
    down: float = 0.0

    def update(self, surprise: float) -> int:
        """Take one z; returns +1 or -1 where the level has stepped up or down, else 0.

        After an alarm the sums begin again.
        """
        self.up = max(0.0, self.up + surprise - ALLOWANCE)
        self.down = max(0.0, self.down - surprise - ALLOWANCE)
        if self.up <= THRESHOLD and self.down <= THRESHOLD:
            return 0
        found = 1 if self.up > THRESHOLD else -1
        self.reset()
        return found

    def reset(self) -> None:
        """Forget everything so far."""
        self.up = self.down = 0.0


def false_alarm_rate() -> float:
    """Alarms per normal z, both sides (D. Siegmund, Sequential Analysis, 1985, chapter 10).

    For z that are normal; real ones have heavier tails, so that this is a lower bound in practice.
    """
    a = 2.0 * ALLOWANCE * (THRESHOLD + 1.166)
    return 2.0 * 2.0 * ALLOWANCE**2 / (math.exp(a) - a - 1.0)
