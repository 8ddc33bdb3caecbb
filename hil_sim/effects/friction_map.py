"""A Coulomb level that varies smoothly over the table."""

from math import erf

import numpy as np

from hil_sim.effects import FRICTION_FACTOR, Effect, EffectPorts, Values, shape, size
from hil_sim.effects.ports import POSITION_MARGIN
from hil_sim.settings import AxisSettings
from stagedata import F64

WAVES = 300
NODE_STEP = 2e-3
"""Largest node distance of the field; shorter for a short correlation length [m]."""


def field_factor(amplitude: float, length: float, seed: float, own: F64, other: F64) -> F64:
    """Evaluate the factor on Fc at positions of the table.

    A Gaussian field with correlation exp(-r^2/(2 length^2)), made of plane waves
    (A. Rahimi, B. Recht, Random features for large-scale kernel machines, 2007), then transformed
    so that all levels within +-amplitude are equally frequent.

    Args:
        amplitude: largest deviation from 1.
        length: correlation length [m].
        seed: selects the field; its integer part counts.
        own: positions of this axis [m].
        other: positions of the other axis [m]; the shapes broadcast.
    """
    generator = np.random.default_rng([0x4D4150, int(seed)])
    k = generator.normal(0.0, 1.0 / length, (2, WAVES))
    phase = generator.uniform(0.0, 2.0 * np.pi, WAVES)
    own, other = np.broadcast_arrays(own, other)
    total = np.zeros(own.shape)
    for i in range(WAVES):
        total += np.cos(k[0, i] * own + k[1, i] * other + phase[i])
    normal = total * np.sqrt(2.0 / WAVES)
    level: F64 = np.vectorize(erf, otypes=[np.float64])(normal / np.sqrt(2.0))
    return np.asarray(1.0 + amplitude * level)


class FrictionMap(Effect):
    """Friction varies over the table, along both axes.

    Thicker lubricant where the table seldom goes, wear where it often goes, straightness and
    preload of the rails of both axes, cables and covers that press harder in one corner.
    """

    group = "friction"
    parameters = (
        size("amplitude", "", "largest deviation from 1", (0.05, 0.3), least=0.0, below=1.0),
        shape("length", "m", "correlation length", (0.02, 0.1), least=5e-3),
        shape(
            "seed", "", "selects the field, by its integer part", (0.0, 1e6), least=0.0, log=False
        ),
    )
    equation = "Fc * (1 + amplitude g(x, y)), g smooth over both axes, within ±1, drawn from seed"
    enters = "A factor on Fc over the positions of both axes."
    remedy = "Calibrate a few dozen sites and use the friction map in the feedforward."
    compensation = FRICTION_FACTOR
    searched = False

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`. The nodes cover this axis' travel, on both axes."""
        length = parameters["length"]
        low, high = ports.axis.travel
        low, high = low - POSITION_MARGIN, high + POSITION_MARGIN
        nodes = np.linspace(low, high, int((high - low) / min(NODE_STEP, length / 10.0)) + 2)
        values = field_factor(
            parameters["amplitude"], length, parameters["seed"], nodes[:, None], nodes[None, :]
        )
        ports.scale_field_coulomb(nodes, nodes, values)

    def refusal(self, parameters: Values, axis: AxisSettings) -> str | None:
        """See `Effect.refusal`: a finer field would need too many nodes."""
        span = axis.travel[1] - axis.travel[0]
        if parameters["length"] < span / 100.0:
            return f"length: must be >= 1/100 of the travel, {span / 100.0:g} m"
        return None
