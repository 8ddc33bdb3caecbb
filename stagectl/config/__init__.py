"""Machine files: YAML with units, validated models, and their settings for the other packages."""

from stagectl.config.history_address import is_server as is_server
from stagectl.config.history_address import without_password as without_password
from stagectl.config.machine import Axis as Axis
from stagectl.config.machine import Machine as Machine
from stagectl.config.machine.file import load_machine as load_machine
from stagectl.config.machine.file import parse_machine as parse_machine
from stagectl.config.settings.package_settings import driver_settings as driver_settings
from stagectl.config.settings.package_settings import eds_path as eds_path
from stagectl.config.settings.package_settings import stage_settings as stage_settings
