"""The settling observers of a run: designed before it, correcting once the stage is enabled."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

from drivers import Stage
from estimation.observer import Design, Kind, StageObserver
from estimation.response import AxisResponse
from stagectl.config.machine import Machine
from stagectl.config.settings.observer import (
    compile_observer,
    design_observers,
    make_observer,
)
from stagectl.measurement import Measurement, identify
from stagectl.run.observer_findings import describe, is_out
from stagectl.run.record import RunRecord
from stagectl.sequencer import AxisCompensation, Mode, ObservedOffsets, events

MEASURE = "measure with: stagectl observer --measure"
UNMEASURED = f"not measured; {MEASURE}"


class Observers:
    """One for each axis that can have one.

    Args:
        machine: as the host believes it.
        compensation: of its axes, whose friction the observers are designed for.
        measurement: of the stage; None where there is none.
        simulated: the stage is virtual: the measurement holds even where it has changed since.
        out: axis -> why its observer is out since an earlier run.

    Attributes:
        out: axis -> why its observer is out since this run.
    """

    def __init__(
        self,
        machine: Machine,
        compensation: Sequence[AxisCompensation],
        measurement: Measurement | None,
        simulated: bool,
        out: Mapping[str, str] | None = None,
    ) -> None:
        self._machine, self._measurement, self._simulated = machine, measurement, simulated
        self._axes = dict(zip(machine.axes, compensation, strict=True))
        friction = {name: axis.estimator.friction for name, axis in self._axes.items()}
        designs = design_observers(machine, friction, self._responses())
        self._designs = {**designs, **(out or {})}
        self.out: dict[str, str] = {}
        self._open: dict[str, str] = {}
        compile_observer(machine)
        self._observer: StageObserver | None = None

    def _responses(self) -> dict[str, AxisResponse | str]:
        """Of each axis as measured, or why that cannot be used."""
        if self._measurement is None:
            return dict.fromkeys(self._machine.axes, UNMEASURED)
        found: dict[str, AxisResponse | str] = {}
        for name in self._machine.axes:
            objection = self._measurement.objection(self._machine, name, self._simulated)
            found[name] = (
                self._measurement.axes[name].response
                if objection is None
                else f"{objection}; {MEASURE}"
            )
        return found

    def _doubt_other_drives(self, stage: Stage) -> None:
        """Do without where a drive is not the one that was measured."""
        measured = self._measurement
        if self._simulated or measured is None:
            return
        for name, now in identify(stage).items():
            then = measured.axes[name].identity if name in measured.axes else None
            other = None if then is None else then.difference(now)
            if other is not None and isinstance(self._designs[name], Design):
                self._designs[name] = f"measured with another drive: {other}; {MEASURE}"

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
        self._bound()
        for a, (name, compensation) in enumerate(self._axes.items()):
            design = self._designs[name]
            if observer.is_on[a] and isinstance(design, Design):
                compensation.observe(design, partial(observer.redesign, a))
        if any(observer.is_on):
            stage.correct_offsets(ObservedOffsets(observer))
        record.note_observer(self._designs, observer.is_on)

    def found(self) -> list[events.ObserverFound]:
        """What the watchdog has found since this was last called; no axis that is out learns on."""
        if self._observer is None:
            return []
        found = []
        names = tuple(self._axes)
        for finding in self._observer.findings():
            name = names[finding.axis]
            text = describe(name, finding)
            self._open.pop(name, None)
            if finding.kind is Kind.SUSPECTED:
                self._open[name] = text
                continue
            if is_out(finding):
                self.out[name] = text
                self._axes[name].unobserve()
            found.append(events.ObserverFound(name, finding.time, is_out(finding), text))
        self._bound()
        return found

    def _bound(self) -> None:
        """Bound each correction by what friction may be."""
        if self._observer is None:
            return
        for a, (name, compensation) in enumerate(self._axes.items()):
            stated = self._machine.axes[name].plant.friction.coulomb
            coulomb = max(stated, compensation.estimator.friction.coulomb)
            self._observer.bound(a, coulomb + compensation.low_speed.level)

    def restart(self) -> None:
        """Forget the motion so far: a fault has ended it."""
        if self._observer is not None:
            self._observer.restart()

    def findings(self) -> list[str]:
        """What moves have shown that the machine file does not have, and is allowed for now."""
        return [
            f"axis {name}: {clause}; it is fed forward"
            for name, compensation in self._axes.items()
            for clause in (
                *compensation.acceleration.describe(),
                *compensation.low_speed.describe(),
            )
        ] + [
            f"axis {name}: friction sticks without presliding; the observer assumes none "
            "(friction.model: coulomb)"
            for name, compensation in self._axes.items()
            if compensation.sticking.found
        ]

    def learned(self) -> dict[str, dict[str, float]]:
        """What is fed forward now besides the machine file's, of each axis that learns it."""
        return {
            name: axis.acceleration.figures()
            for name, axis in self._axes.items()
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
        return list(self._open.values()) + [
            f"axis {name}: the observer's estimate was not finite; its correction stayed as it was"
            for name, failed in zip(self._axes, self._observer.failed, strict=True)
            if failed
        ]
