"""Friction laws, their state, and the friction force along a path."""

from estimation.friction.coulomb_variation import level_with_target as level_with_target
from estimation.friction.coulomb_variation import state_after as state_after
from estimation.friction.feedforward import friction_feedforward as friction_feedforward
from estimation.friction.follow import REST_BAND as REST_BAND
from estimation.friction.follow import follow as follow
from estimation.friction.follow import follow_positions as follow_positions
from estimation.friction.gms import element_shares as element_shares
from estimation.friction.model import FrictionState as FrictionState
from estimation.friction.model import breakaway_travel as breakaway_travel
from estimation.friction.model import count_states as count_states
from estimation.friction.model import kernel_figures as kernel_figures
from estimation.friction.model import make_constants as make_constants
from stagedata import F64 as F64
