"""The settling observers of a run: designed before it, correcting once the stage is enabled."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from drivers import Stage
from estimation.observer import Design, StageObserver
from estimation.response import AxisResponse
from stagectl.config.machine import Machine
from stagectl.config.settings.observer import (
    compile_observer,
    design_observers,
    make_observer,
)
from stagectl.measurement import Measurement, identify
from stagectl.run.record import RunRecord
from stagectl.sequencer import AxisCompensation, Mode, ObservedOffsets

MEASURE = "measure with: stagectl observer --measure"
UNMEASURED = f"not measured; {MEASURE}"


class Observers:
    """One for each axis that can have one.

    Args:
        machine: as the host believes it.
        compensation: of its axes, whose friction the observers are designed for.
        measurement: of the stage; None where there is none.
        simulated: the stage is virtual: the measurement holds even where it has changed since.
    """

    def __init__(
        self,
        machine: Machine,
        compensation: Sequence[AxisCompensation],
        measurement: Measurement | None,
        simulated: bool,
    ) -> None:
        self._machine, self._compensation = machine, compensation
        self._measurement, self._simulated = measurement, simulated
        axes = zip(machine.axes, compensation, strict=True)
        friction = {name: axis.estimator.friction for name, axis in axes}
        self._designs = design_observers(machine, friction, self._responses())
        compile_observer(machine)
        self._observer: StageObserver | None = None

    def _responses(self) -> dict[str, AxisResponse | str]:
        """Of each axis as measured, or why that cannot be used."""
        if self._measurement is None:
            return dict.fromkeys(self._machine.axes, UNMEASURED)
        found: dict[str, AxisResponse | str] = {}
        for name, axis in self._machine.axes.items():
            objection = self._measurement.objection(
                name, axis, self._machine.bus.sync_period, self._simulated
            )
            found[name] = objection or self._measurement.axes[name].response
        return found

    def _doubt_other_drives(self, stage: Stage) -> None:
        """Do without where a drive is not the one that was measured."""
        measured = self._measurement
        if self._simulated or measured is None:
            return
        for name, now in identify(stage).items():
            then = measured.axes[name].identity if name in measured.axes else None
            if then is not None and then != now and isinstance(self._designs[name], Design):
                self._designs[name] = f"measured with another drive ({then}, now {now}); {MEASURE}"

    def attach(self, stage: Stage, record: RunRecord) -> None:
        """Have the force offsets of the enabled stage corrected; the record says of which axes.

        Raises:
            DriverError: a drive's identity cannot be read.
        """
        self._doubt_other_drives(stage)
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

    def without(self) -> list[str]:
        """Which axes have no observer because of their measurement, and what to do."""
        reasons: dict[str, list[str]] = {}
        for name, found in self._designs.items():
            if isinstance(found, str) and MEASURE in found:
                reasons.setdefault(found, []).append(name)
        return [
            f"{'axis' if len(names) == 1 else 'axes'} {', '.join(names)}: no observer: {reason}"
            for reason, names in reasons.items()
        ]

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
