"""One run on the open bus: boot, homing, the recipe (`sequencer.Engine`), disabling.

Whatever happens on the way, the stage ends disabled, and what was measured becomes the recording.
"""

from __future__ import annotations

import time
from collections.abc import Sequence

from drivers import AxisFault, DriverError, Stage
from drivers.cyclic import Sample, Sink
from drivers.settings import AxisSettings
from estimation.trajectory import Limits
from hil_sim.bus import InjectedFault
from stagectl.errors import Aborted, ConfigError, RunFault, StagectlError
from stagectl.history import stage_temperature
from stagectl.maps import ActiveMap, sites_outside
from stagectl.measurement import never_checked
from stagectl.recipe import Excite, plan_from
from stagectl.run.access import StageAccess, both
from stagectl.run.checks import Checked, Substitutes
from stagectl.run.listener import Listener
from stagectl.run.observer_findings import keep_out, read_out
from stagectl.run.observers import Observers
from stagectl.run.record import RunRecord
from stagectl.run.request import RunRequest, RunResult
from stagectl.run.retries import recover_stage
from stagectl.sequencer import (
    AxisCompensation,
    Engine,
    Event,
    FreshPlaces,
    Mode,
    MovingAxis,
    Places,
    events,
)
from stagectl.store import MOVED_BY_PROFILE, BusLog

BY_PROFILE = (
    "moves go by the drives' own profiles (pp): nothing is compensated, and errors and settling "
    "count from the moment a target is handed over"
)
"""Of a run with a drive without csp."""


class _EarlyStop(KeyboardInterrupt):
    """The operator's stop before anything moves; not caught by any `except Exception`."""


class Session:
    """The part of a run that has a record: the stage from opening to disabling."""

    def __init__(
        self,
        request: RunRequest,
        listener: Listener,
        found: Checked,
        compensation: Sequence[AxisCompensation],
        substitutes: Substitutes | None,
    ) -> None:
        self._request, self._listener, self._found = request, listener, found
        self._substitutes, active = substitutes, found.active
        self._compensation = compensation
        self._places = self._places_of(active)
        self._observers: Observers | None = None
        if request.host.observer:
            self._observers = Observers(
                request.machine,
                compensation,
                request.host.measurement,
                simulated=request.truth is not None or substitutes is not None,
                out=self._out_since_before(),
            )
        self._stage: Stage | None = None
        self._log: BusLog | None = None
        self._engine: Engine | None = None
        self._error: StagectlError | None = None
        self._over = False
        self._early_stop: str | None = None
        # Last: what takes time comes before there is a journal for a stop to leave behind.
        self._record = RunRecord(request, found.started, active, found.effects)
        if active is not None:
            self._record.note_limitations(sites_outside(active.version, request.recipe.sites))

    def _out_since_before(self) -> dict[str, str]:
        """Axes of a real stage whose observers are out since an earlier run, and why."""
        request = self._request
        if request.truth is not None or self._substitutes is not None:
            return {}
        measurement = request.host.measurement
        return read_out(request.machine, None if measurement is None else measurement.measured)

    def _places_of(self, active: ActiveMap | None) -> Places | None:
        """Friction over the table: the map's, or unknown in a calibration without one."""
        if active is not None:
            active.places.on_step = self._on_event
            return active.places
        if not self._request.recipe.excursions:
            return None
        axes = zip(self._request.machine.axes, self._compensation, strict=True)
        return FreshPlaces({name: axis.estimator.friction.coulomb for name, axis in axes})

    def operate(self, access: StageAccess, injected: Sequence[InjectedFault] = ()) -> None:
        """Run the recipe on the stage; foreseen errors are kept for the result.

        Args:
            access: to the stage.
            injected: faults, as they are injected.
        """
        if access.held:
            self._record.journal.event("held_stage")
        log = self._log = BusLog(self._request.folder / "bus.asc", self._request.started)
        try:
            self._operate(access, log)
        except BaseException:
            log.close()
            raise
        self._record.note_injected_faults(injected)

    def leave(self) -> StagectlError | None:
        """Close the journal and the frames of the bus, for another process to make the files of.

        Returns:
            What ended the run early, or None.
        """
        if self._log is not None:
            self._log.leave()
        self._record.end(self._error)
        return self._error

    def give_up(self, error: StagectlError) -> None:
        """End the run before `operate`, for this reason."""
        self._error = error

    def finish(self) -> RunResult:
        """Make the files of the run."""
        log = self._log
        if log is not None:
            log.close()
            if log.digest is not None:  # by which the recording knows its own log
                self._record.journal.event("bus_log", digest=log.digest)
        self._listener.phase("writing recording and report")
        return self._record.finish(self._error)

    def _operate(self, access: StageAccess, log: BusLog) -> None:
        """Make the stage ready, run, leave it."""
        listener, record = self._listener, self._record
        try:
            self._name_effects_left()
            listener.stoppable(self._request_stop)
            with access.stage(log) as stage:
                self._stage = stage
                self._heed_early_stop()
                for phase, step in access.boot(stage):
                    listener.phase(phase)
                    step()
                    self._heed_early_stop()
                record.start()
                for text in (*self._unchecked(), *stage.limitations):
                    self._on_event(events.Limitation(text))
                self._use_profiles(stage)
                for phase, step in access.make_ready(stage):
                    listener.phase(phase)
                    step()
                    self._heed_early_stop()
                self._run_on(stage)
                access.leave(stage, listener.phase)
        except DriverError as error:
            self._error = RunFault(str(error))
            if self._early_stop is not None:
                self._error = Aborted(f"{self._early_stop}; then {error}")
        except _EarlyStop as stop:
            self._error = Aborted(str(stop))
        except (Aborted, RunFault, ConfigError) as error:
            self._error = error
        except BaseException:
            record.abandon()  # an error of ours: keep the samples, then show it
            raise
        finally:
            self._over = True

    def _run_on(self, stage: Stage) -> None:
        """Run the recipe on the enabled stage, with what belongs to it before and after."""
        record, observers = self._record, self._observers
        if observers is not None:
            observers.attach(stage, record)
            record.note_limitations(observers.without())
        record.note_limitations((*stage.limitations, *stage.notices))
        record.temperature = stage_temperature(
            self._request.machine, stage, self._found.thermometer
        )
        record.temperature.at(0.0)
        begin = time.perf_counter()
        try:
            self._run_recipe(stage, stage.settings.sync_period)
        finally:
            record.wall_time = time.perf_counter() - begin
            record.note_limitations(stage.notices)
            if observers is not None:
                self._tell_found(observers)
                record.note_limitations((*observers.failures(), *observers.findings()))
                record.journal.event("feedforward", axes=observers.learned())
                self._keep_out(observers)

    def _use_profiles(self, stage: Stage) -> None:
        """Where a drive does not offer csp: moves by the drives' own profiles, if the recipe can.

        Raises:
            ConfigurationError, NodeError: it cannot, or a drive does not take its profiles; before
                power.
        """
        if stage.streams:
            return
        recipe = self._request.recipe
        if recipe.excursions or any(isinstance(step, Excite) for step in plan_from(recipe, 0)):
            stage.require_csp()
        for axis in stage.axes:
            limits = axis.settings
            for profile in (recipe.macro, recipe.micro):
                speed = min(profile.velocity, limits.velocity)
                stage.check_move_to(
                    axis.name, speed, min(profile.acceleration, limits.acceleration)
                )
        self._observers = None
        self._record.journal.event(MOVED_BY_PROFILE)
        self._on_event(events.Limitation(BY_PROFILE))

    def _unchecked(self) -> list[str]:
        """On a real stage: which axes were never checked by a move."""
        if self._request.truth is not None or self._substitutes is not None:
            return []
        line = never_checked(self._request.machine)
        return [] if line is None else [line]

    def _name_effects_left(self) -> None:
        """Say which effects of the machine file the host does not make up for, and why."""
        if self._request.host.mode is Mode.NONE:
            return
        for effect in self._record.effects:
            if not effect.compensated:
                self._on_event(events.Limitation(effect.describe()))

    def _run_recipe(self, stage: Stage, period: float) -> None:
        """Run what is left of the recipe; repeat a segment after a fault that allows it."""
        record, recipe, limit = self._record, self._request.recipe, self._request.retries
        start = stage.targets[0], stage.targets[1]
        engine = self._engine = Engine(
            stage,
            self._moving_axes([axis.settings for axis in stage.axes]),
            self._found.fiducial,
            period,
            record.note_move,
            self._on_event,
            self._places,
            self._listener.pause,
        )
        attempt, attempted = 0, record.done
        while True:
            stage.sink = self._sample_sink(engine)
            try:
                engine.run(plan_from(recipe, record.done, start))
                return
            except AxisFault as fault:
                attempt = attempt + 1 if record.done == attempted else 1
                attempted = record.done
                attempt = recover_stage(
                    stage,
                    fault,
                    attempt,
                    limit,
                    lambda number, why: self._on_event(
                        events.Retrying(record.done + 1, number, limit, why)
                    ),
                )
                if self._observers is not None:
                    self._observers.restart()
                interrupted = engine.restart(record.journal.samples)
                if interrupted is not None:
                    record.journal.move(interrupted)  # where it really ended
            finally:
                stage.sink = None

    def _moving_axes(self, axes: Sequence[AxisSettings]) -> tuple[MovingAxis, ...]:
        """The axes with the limits of their drives, which may be below the machine file's."""
        moving = []
        for axis, compensation in zip(axes, self._compensation, strict=True):
            compensation.saturates_at(axis.peak_force)
            moving.append(
                MovingAxis(
                    axis.name,
                    Limits(axis.velocity, axis.acceleration, axis.jerk),
                    axis.increment,
                    compensation,
                    axis.following_error,
                    self._request.machine.axes[axis.name].plant.mass,
                )
            )
        return tuple(moving)

    def _sample_sink(self, engine: Engine) -> Sink:
        """Where samples go: the journal; a replay also counts them up to the operator's stop."""
        journal, shown = self._record.journal, self._listener.sample
        if shown is not None:
            return both(journal.sink, shown)
        if self._substitutes is None or self._substitutes.stop is None:
            return journal.sink
        samples, reason = self._substitutes.stop

        def sink(sample: Sample) -> None:
            journal.sink(sample)
            if journal.samples == samples:
                engine.stop(reason)

        return sink

    def _request_stop(self, reason: str) -> None:
        """Stop the engine, or abandon the preparations if it does not run yet.

        A stage that is already stopping is left to do so.

        Raises:
            _EarlyStop: while the stage is being booted or homed.
        """
        if self._engine is not None:
            self._engine.stop(reason)
        elif not self._over and (self._stage is None or not self._stage.ending):
            self._early_stop = reason
            raise _EarlyStop(reason)

    def _heed_early_stop(self) -> None:
        """Stop now if it was requested where an exception is lost, as within a finalizer."""
        if self._early_stop is not None:
            raise _EarlyStop(self._early_stop)

    def _tell_found(self, observers: Observers) -> None:
        """Tell what the observers' watchdog has found, where it is."""
        for found in observers.found():
            self._record.note_event(found)
            self._listener.event(found)

    def _keep_out(self, observers: Observers) -> None:
        """On a real stage: let later runs know which observers are out."""
        request = self._request
        if observers.out and request.truth is None and self._substitutes is None:
            try:
                kept = keep_out(request.machine, observers.out, request.started)
            except StagectlError as error:
                kept = str(error)
            self._record.note_limitations([kept])

    def _on_event(self, event: Event) -> None:
        if self._observers is not None and not isinstance(event, events.StopNoticed):
            self._tell_found(self._observers)
        self._record.note_event(event)
        self._listener.event(event)
