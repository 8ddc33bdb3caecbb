"""Friction over the table: maps of the Coulomb force, its tracking at sites, steps of it."""

from estimation.field.friction_field import KERNELS as KERNELS
from estimation.field.friction_field import FrictionField as FrictionField
from estimation.field.friction_field import Node as Node
from estimation.field.process_noise import DAY as DAY
from estimation.field.process_noise import ProcessNoise as ProcessNoise
from estimation.field.process_noise import Series as Series
from estimation.field.process_noise import learn as learn
from estimation.field.site_tracking import COMMON as COMMON
from estimation.field.site_tracking import SITES as SITES
from estimation.field.site_tracking import Observation as Observation
from estimation.field.site_tracking import SiteTracker as SiteTracker
from estimation.field.site_tracking import TrackingSettings as TrackingSettings
