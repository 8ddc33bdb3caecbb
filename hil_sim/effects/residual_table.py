"""A force over position, direction and velocity as tables: a description of what is left over."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from hil_sim.effects import HOST, Compensation, Effect, EffectPorts, Parameter
from hil_sim.settings import AxisSettings

_STEEPEST = 0.5
"""Limit of damping x control period / mass and of stiffness x control period^2 / mass."""
MOST_NODES = 1000


class ResidualTable(Effect):
    """What no effect of the library explains, measured and not understood.

    It is a description and no cause: nothing says that it holds where the axis has not been, or
    next week. A gap diagnosis writes it into a twin, and never finds it.
    """

    group = "force"
    parameters = (
        Parameter("position", "m", "nodes over position, increasing", role="table"),
        Parameter("force", "N", "force at each position", role="table"),
        Parameter(
            "coulomb", "", "factor on the Coulomb level at each position", role="table", least=0.0
        ),
        Parameter("velocity", "m/s", "nodes over velocity, increasing", role="table"),
        Parameter("velocity_force", "N", "force at each velocity", role="table"),
    )
    equation = "F_d += force(x) + velocity_force(v), Fc * coulomb(x); linear between nodes"
    enters = "Disturbance forces over position and velocity, and a factor on Fc over position."
    remedy = "Find the cause: until then, feed the table forward."
    compensation = Compensation(
        "forces fed forward, the factor as the Coulomb force of the friction model, along the "
        "planned path",
        HOST,
    )
    searched = False

    def apply(self, ports: EffectPorts, parameters: Mapping[str, Any]) -> None:
        """See `Effect.apply`. Tables are held at their ends."""
        places, speeds = parameters["position"], parameters["velocity"]
        ports.add_position_force(np.interp(ports.positions, places, parameters["force"]))
        ports.scale_position_coulomb(np.interp(ports.positions, places, parameters["coulomb"]))
        ports.add_velocity_force(np.interp(ports.velocities, speeds, parameters["velocity_force"]))

    def refusal(self, parameters: Mapping[str, Any], axis: AxisSettings) -> str | None:
        """See `Effect.refusal`: tables that do not fit their nodes, or are too steep.

        The factor `coulomb` counts as the force that it makes of the axis' Coulomb force.
        """
        period, coulomb = axis.control.period, axis.friction.coulomb
        over_position = _STEEPEST * axis.mass / period**2
        over_velocity = _STEEPEST * axis.mass / period
        for nodes, table, scale, steepest, unit in (
            ("position", "force", 1.0, over_position, "N/m"),
            ("position", "coulomb", coulomb, over_position, "N/m"),
            ("velocity", "velocity_force", 1.0, over_velocity, "N s/m"),
        ):
            unfit = refuse_nodes(parameters, nodes, table)
            if unfit is not None:
                return unfit
            at, heights = np.array(parameters[nodes]), scale * np.array(parameters[table])
            slope, highest = float(np.abs(np.diff(heights) / np.diff(at)).max()), heights.max()
            if slope > steepest:
                return f"{table}: changes by {slope:.3g} {unit}, at most {steepest:.3g} {unit}"
            if table == "coulomb" and highest > (peak := axis.control.peak_force):
                return f"{table}: friction of {highest:.3g} N is above the peak force of {peak:g} N"
        return None


def refuse_nodes(parameters: Mapping[str, Any], nodes: str, table: str) -> str | None:
    """Why a table cannot belong to its nodes, keys of `parameters`; None where it can."""
    at, heights = np.array(parameters[nodes]), np.array(parameters[table])
    if not 2 <= len(at) <= MOST_NODES:
        return f"{nodes}: must have 2 to {MOST_NODES} nodes, has {len(at)}"
    if not (np.diff(at) > 0.0).all():
        return f"{nodes}: must increase from node to node"
    if len(heights) != len(at):
        return f"{table}: must have {len(at)} values like {nodes}, has {len(heights)}"
    return None
