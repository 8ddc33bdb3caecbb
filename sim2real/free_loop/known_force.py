"""A force over time that is known beside a model, such as a curve's along the recorded motion."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from hil_sim.effects import AppliedEffect, Effect, EffectPorts, Parameter
from stagedata import F64


class _KnownForce(Effect):
    """A force that is known from elsewhere."""

    group = "force"
    parameters = (Parameter("force", "N", "at each SYNC", role="table"),)
    equation = "F_d += force(t)"
    enters = "A force over time."
    remedy = "None: it is known."
    searched = False

    def apply(self, ports: EffectPorts, parameters: Mapping[str, Any]) -> None:
        """See `Effect.apply`. The last value stays."""
        force = np.asarray(parameters["force"])
        ports.add_time_force(force[np.minimum(np.arange(len(ports.times)), len(force) - 1)])


def known_force(force: F64) -> AppliedEffect:
    """A force against the motion at each SYNC, float64[K] [N]."""
    return _KnownForce().at(force=tuple(force.tolist()))
