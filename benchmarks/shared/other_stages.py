"""Stages that are not as the machine file says."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from stagectl.config.machine import Machine
from stagedata import LAW_FIGURES, LawName

LEAST, MOST = 0.6, 1.6


def drawn(machine: Machine, seed: int) -> Machine:
    """Another stage of the same build."""
    generator = np.random.default_rng([seed, 77])
    axes = {}
    for name, axis in machine.axes.items():
        friction = axis.plant.friction
        factor = dict(
            zip(
                ("coulomb", "viscous", "stiffness", "attraction"),
                generator.uniform(LEAST, MOST, 4).tolist(),
                strict=True,
            )
        )
        friction = friction.model_copy(
            update={name: getattr(friction, name) * f for name, f in factor.items()}
        )
        plant = axis.plant.model_copy(update={"friction": friction})
        axes[name] = axis.model_copy(update={"plant": plant})
    return machine.model_copy(update={"axes": axes})


def of_law(machine: Machine, law: LawName) -> Machine:
    """The same stage under another friction law, without the figures that it does not have."""
    axes = {}
    for name, axis in machine.axes.items():
        gone = {key: None for key in LAW_FIGURES["gms"] if key not in LAW_FIGURES[law]}
        friction = axis.plant.friction.model_copy(update={"model": law, **gone})
        plant = axis.plant.model_copy(update={"friction": friction})
        axes[name] = axis.model_copy(update={"plant": plant})
    return machine.model_copy(update={"axes": axes})


def with_gains(machine: Machine, factors: Mapping[str, float]) -> Machine:
    """The machine with other gains of its drives."""
    axes = {}
    for name, axis in machine.axes.items():
        own = axis.drive.pid
        assert own is not None
        pid = own.model_copy(update={k: getattr(own, k) * f for k, f in factors.items()})
        drive = axis.drive.model_copy(update={"pid": pid})
        axes[name] = axis.model_copy(update={"drive": drive})
    return machine.model_copy(update={"axes": axes})
