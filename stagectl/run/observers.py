"""The settling observers of a run: designed before it, correcting once the stage is enabled."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from drivers import Stage
from estimation.observer import Design, StageObserver
from stagectl.config.machine import Machine
from stagectl.config.settings.observer import (
    compile_observer,
    design_observers,
    make_observer,
)
from stagectl.run.record import RunRecord
from stagectl.sequencer import AxisCompensation, Mode, ObservedOffsets


class Observers:
    """One for each axis that can have one.

    Args:
        machine: as the host believes it.
        compensation: of its axes, whose friction the observers are designed for.
    """

    def __init__(self, machine: Machine, compensation: Sequence[AxisCompensation]) -> None:
        self._machine, self._compensation = machine, compensation
        axes = zip(machine.axes, compensation, strict=True)
        friction = {name: axis.estimator.friction for name, axis in axes}
        self._designs = design_observers(machine, friction)
        compile_observer(machine)
        self._observer: StageObserver | None = None

    def attach(self, stage: Stage, record: RunRecord) -> None:
        """Have the force offsets of the enabled stage corrected; the record says of which axes."""
        observer = self._observer = make_observer(
            self._machine,
            self._designs,
            [
                axis.settings.peak_force if axis.accepts_force_offset else None
                for axis in stage.axes
            ],
        )
        axes = zip(self._compensation, self._designs.values(), observer.is_on, strict=True)
        for a, (compensation, design, is_on) in enumerate(axes):
            if is_on and isinstance(design, Design):
                compensation.observe(design, partial(observer.redesign, a))
        if any(observer.is_on):
            stage.correct_offsets(ObservedOffsets(observer))
        record.note_observer(self._designs, observer.is_on)

    def restart(self) -> None:
        """Forget the motion so far: a fault has ended it."""
        if self._observer is not None:
            self._observer.restart()

    def findings(self) -> list[str]:
        """What moves have shown that the machine file does not have, and is allowed for now."""
        axes = list(zip(self._machine.axes, self._compensation, strict=True))
        return [
            f"axis {name}: {clause}; it is fed forward"
            for name, compensation in axes
            for clause in (
                *compensation.acceleration.describe(),
                *compensation.low_speed.describe(),
            )
        ] + [
            f"axis {name}: friction sticks without presliding; the observer assumes none "
            "(friction.model: coulomb)"
            for name, compensation in axes
            if compensation.sticking.found
        ]

    def learned(self) -> dict[str, dict[str, float]]:
        """What is fed forward now besides the machine file's, of each axis that learns it."""
        axes = zip(self._machine.axes, self._compensation, strict=True)
        return {
            name: axis.acceleration.figures()
            for name, axis in axes
            if axis.observed and axis.mode is Mode.ESTIMATED
        }

    def failures(self) -> list[str]:
        """What the operator should know of observers that ended early."""
        if self._observer is None:
            return []
        axes = zip(self._machine.axes, self._observer.failed, strict=True)
        return [
            f"axis {name}: the observer's estimate was not finite; its correction stayed as it was"
            for name, failed in axes
            if failed
        ]
