"""The force that accelerates an axis, fed forward: by the machine file, and by what moves show.

Mass, lead of the force offset, and a share of the other axis' acceleration are corrected after each
long move that the settling observer watched (`estimation.observer.feedforward_error`).
"""

from __future__ import annotations

from estimation.acceleration_feedforward import mass_feedforward
from estimation.observer import (
    COUPLING,
    LEAD,
    MASS,
    Course,
    Design,
    FeedforwardErrors,
    LearnedFeedforward,
)
from estimation.trajectory import Trajectory
from stagedata import F64

REPORTED = (0.02, 1e-4, 0.01)
"""Changes of mass [1], lead [s] and coupling [1] above which the operator is told of them."""

MEASURED = 0.05
"""A measured force per acceleration that is off by less is left to moves, which know better."""


class AccelerationForce:
    """The force fed forward to accelerate one axis, and what moves show it to lack.

    Args:
        mass: moved, by the machine file [kg].
        delay: from a force offset to its effect, by the machine file, without the current loop's
            lag [s].
        period: Ts [s].
    """

    def __init__(self, mass: float, delay: float, period: float) -> None:
        self._file = mass, delay
        self._mass, self._delay, self._period = mass, delay, period
        self._learned = LearnedFeedforward()
        self._errors: FeedforwardErrors | None = None

    @property
    def mass(self) -> float:
        """Force per acceleration that is fed forward [kg]."""
        return self._mass * (1.0 + float(self._learned.fed[MASS]))

    @property
    def ahead(self) -> float:
        """How much earlier than its effect a force is sent, besides the current loop's lag [s]."""
        return self._delay + float(self._learned.fed[LEAD])

    def figures(self) -> dict[str, float]:
        """What is fed forward besides the machine file's: share of the mass, lead [s], coupling."""
        mass, delay = self._file
        return {
            "mass": self.mass / mass - 1.0,
            "lead": self.ahead - delay,
            "coupling": float(self._learned.fed[COUPLING]) * self._mass / mass,
        }

    def describe(self) -> list[str]:
        """What is fed forward that the machine file does not have, as clauses."""
        mass, lead, coupling = self.figures().values()
        found = []
        if abs(mass) > REPORTED[MASS]:
            more = f"{100.0 * abs(mass):.1f} % {'more' if mass > 0.0 else 'less'}"
            found.append(
                f"acceleration takes {more} force than the machine file says, whether by mass or "
                "motor constant (`stagectl gap excite`, its run and `stagectl gap diagnose` decide)"
            )
        if abs(lead) > REPORTED[LEAD]:
            when = "later" if lead > 0.0 else "earlier"
            found.append(f"force acts {1e3 * abs(lead):.2f} ms {when} than the machine file says")
        if abs(coupling) > REPORTED[COUPLING]:
            share = f"{100.0 * abs(coupling):.1f} %"
            found.append(f"the other axis' acceleration acts on {share} of the mass")
        return found

    def along(self, trajectory: Trajectory, across: Trajectory | None, samples: int) -> F64:
        """Force at setpoints 1 to `samples` [N], shape (samples,).

        Args:
            trajectory: demand of the axis.
            across: demand of the other axis; None where there is none, or it rests.
            samples: number of setpoints.
        """
        force = mass_feedforward(self.mass, trajectory, samples, self._period, self.ahead)
        coupled = self._mass * float(self._learned.fed[COUPLING])
        if across is not None and coupled:
            force = force + mass_feedforward(coupled, across, samples, self._period, self.ahead)
        return force

    def learn_with(self, design: Design) -> None:
        """Begin to learn: an observer of this design corrects the offsets from now on.

        Where the axis was measured, force per acceleration and lead are fed forward as they are.
        """
        own = design.figures
        if own.measured is not None:
            mass, delay = self._file
            is_off = abs(own.carriage.mass / mass - 1.0) > MEASURED
            self._mass, self._delay = own.carriage.mass if is_off else mass, delay + own.lead
        self._errors = FeedforwardErrors(design, self._mass)

    def forget(self) -> None:
        """Feed forward what the machine file says, and learn no more: the observer is out."""
        self._learned, self._errors = LearnedFeedforward(), None
        self._mass, self._delay = self._file

    def learn(self, course: Course) -> None:
        """Correct what is fed forward by what a move lacked; does nothing without an observer."""
        if self._errors is None:
            return
        error = self._errors.find(course, 1.0 + float(self._learned.fed[MASS]))
        if error is not None:
            self._learned.take(error)
