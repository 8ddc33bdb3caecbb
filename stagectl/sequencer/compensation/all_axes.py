"""The compensation of every axis of a machine, its kernels compiled before anything moves."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from estimation.known_effects import known_figures
from estimation.move import MoveData
from estimation.trajectory import Limits, plan
from stagectl.config.machine import Axis, Machine
from stagectl.config.settings.host_model import drive_loop, estimator_settings
from stagectl.config.settings.known_effects import axis_as_known, known_terms
from stagectl.sequencer.compensation.axis_compensation import AtRest, AxisCompensation, AxisMotion
from stagectl.sequencer.compensation.known_axis import KnownAxis
from stagectl.sequencer.compensation.mode import Figures, Mode
from stagectl.sequencer.samples.move_data import prepare_move_data
from stagedata import Samples


def make_compensation(
    machine: Machine,
    mode: Mode,
    scale: float = 1.0,
    truth: Machine | None = None,
    known: Mapping[str, Figures] | None = None,
    drift: Mapping[str, Mapping[str, float]] | None = None,
    mapped: bool = False,
    calibration: bool = False,
) -> tuple[AxisCompensation, ...]:
    """Compensation of every axis in the machine's order, its kernels compiled.

    Args:
        machine: the host's model of the stage.
        mode: what the offsets consist of.
        scale: factor on the machine file's friction figures; those of `truth` are not scaled.
        truth: machine whose friction figures to use in mode ORACLE.
        known: axis -> figures that an earlier run has learned, for mode ESTIMATED.
        drift: axis -> relative 1-sigma per move of the figures by name, where a friction map
            accounts for the Coulomb force over the table; None without one.
        mapped: whether the Coulomb force over place and time has been or is being measured; effects
            that change it are then not compensated separately.
        calibration: whether the run measures friction at calibration sites.
    """
    source = truth if mode is Mode.ORACLE and truth is not None else machine
    scale = scale if source is machine else 1.0
    terms = {} if mode is Mode.NONE else known_terms(machine, mapped)
    of_figures = terms if source is machine else known_terms(source)
    period = machine.bus.sync_period
    made = []
    for number, (name, axis) in enumerate(machine.axes.items()):
        figures = source.axes[name].plant.friction.figures.scaled(scale)
        if name in of_figures:
            figures = known_figures(of_figures[name], figures)
        effects = None
        if name in terms:
            axis = axis_as_known(axis, terms[name])
            effects = KnownAxis(terms[name], number, axis, period)
            effects.compile_kernels()
        own_drift = None if drift is None else drift.get(name, {})
        settings = estimator_settings(axis, period, own_drift, calibration)
        made.append(AxisCompensation(axis, figures, mode, period, settings, effects))
        if mode is Mode.ESTIMATED and known is not None and name in known:
            made[-1].estimator.believe(known[name])
    compile_kernels(machine, estimator=True)
    return tuple(made)


def compile_kernels(machine: Machine, estimator: bool) -> None:
    """Compile, or load from the cache, what moves need, before anything moves.

    Args:
        machine: the host's.
        estimator: the estimator's kernels, first of all, and not only those of the feedforward.
    """
    kinds = {
        (axis.plant.friction.model, drive_loop(axis.drive) is None): axis
        for axis in machine.axes.values()
    }
    prepare_move_data(Samples.missing(1, len(machine.axes)), np.zeros(len(machine.axes)), [], 1.0)
    for axis in kinds.values():
        _compile_kernels(axis, machine.bus.sync_period, estimator)


def _compile_kernels(axis: Axis, period: float, estimator: bool) -> None:
    """Run the compiled kernels once on a throw-away axis."""
    figures, settings = axis.plant.friction.figures, estimator_settings(axis, period)
    compensation = AxisCompensation(axis, figures, Mode.ESTIMATED, period, settings)
    limits = axis.limits
    motion = plan(
        0.0, 1e-3, Limits(limits.velocity / 10, limits.acceleration / 10, limits.jerk / 10)
    )
    samples = math.ceil(motion.duration / period) + 20
    position = motion.sample(np.asarray(np.arange(samples) * period, np.float64))[0]
    force, valid = np.zeros(samples), np.ones(samples, dtype=np.bool_)
    for start in (0.0, 1.0, 2.0):
        if estimator:
            compensation.learn(MoveData(position, force, valid, start, 0.0))
        demand = AxisMotion(motion, None, samples)
        force = compensation.force_offsets(demand, AtRest(0.0, 0.0, 0.0, 0.0))
