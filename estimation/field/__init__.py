"""Friction over the table: maps of the Coulomb force, its tracking at sites, steps of it."""

from estimation.field.change import StepDetector, false_alarm_rate
from estimation.field.convex_hull import Hull
from estimation.field.friction_field import KERNELS, FrictionField, Node
from estimation.field.process_noise import DAY, ProcessNoise, Series, learn
from estimation.field.site_tracking import (
    COMMON,
    SITES,
    TREND,
    Observation,
    SiteTracker,
    TrackingSettings,
)

__all__ = [
    "COMMON",
    "DAY",
    "KERNELS",
    "SITES",
    "TREND",
    "FrictionField",
    "Hull",
    "Node",
    "Observation",
    "ProcessNoise",
    "Series",
    "SiteTracker",
    "StepDetector",
    "TrackingSettings",
    "false_alarm_rate",
    "learn",
]
