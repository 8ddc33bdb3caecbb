"""Machine files: YAML with units, validated models, and their settings for the other packages."""

from stagectl.config.history_address import is_server, without_password
from stagectl.config.machine import Axis, Drive, Machine
from stagectl.config.machine.file import load_machine, parse_machine
from stagectl.config.settings.package_settings import driver_settings, eds_path, stage_settings

__all__ = [
    "Axis",
    "Drive",
    "Machine",
    "driver_settings",
    "eds_path",
    "is_server",
    "load_machine",
    "parse_machine",
    "stage_settings",
    "without_password",
]
