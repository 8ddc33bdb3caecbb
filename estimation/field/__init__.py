"""Friction over the table: maps of the Coulomb force, its tracking at sites, steps of it."""

from estimation.field.friction_field import KERNELS, FrictionField, Node
from estimation.field.process_noise import DAY, ProcessNoise, Series, learn
from estimation.field.site_tracking import COMMON, SITES, Observation, SiteTracker, TrackingSettings

__all__ = [
    "COMMON",
    "DAY",
    "KERNELS",
    "SITES",
    "FrictionField",
    "Node",
    "Observation",
    "ProcessNoise",
    "Series",
    "SiteTracker",
    "TrackingSettings",
    "learn",
]
