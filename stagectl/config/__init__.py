"""Machine files: hardened YAML, units, validated models, and their way to the lower packages."""

from stagectl.config.machine import Axis as Axis
from stagectl.config.machine import Machine as Machine
from stagectl.config.machine_file import load_machine as load_machine
from stagectl.config.machine_file import parse_machine as parse_machine
from stagectl.config.mapping import driver_settings as driver_settings
from stagectl.config.mapping import stage_settings as stage_settings
