"""Friction laws, their state, and the friction force along a path."""

from estimation.friction.coulomb_variation import (
    level_with_target,
    state_after,
    varying_feedforward,
)
from estimation.friction.feedforward import (
    friction_feedforward,
)
from estimation.friction.follow import (
    REST_BAND,
    SUBSTEPS,
    follow,
    follow_positions,
    steps_within,
)
from estimation.friction.gms import element_shares
from estimation.friction.law import F64
from estimation.friction.model import (
    FrictionState,
    breakaway_travel,
    count_states,
    kernel_figures,
    make_constants,
)

__all__ = [
    "F64",
    "REST_BAND",
    "SUBSTEPS",
    "FrictionState",
    "breakaway_travel",
    "count_states",
    "element_shares",
    "follow",
    "follow_positions",
    "friction_feedforward",
    "kernel_figures",
    "level_with_target",
    "make_constants",
    "state_after",
    "steps_within",
    "varying_feedforward",
]
