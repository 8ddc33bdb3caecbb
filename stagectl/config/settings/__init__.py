"""What a machine file is to the lower packages.

`package_settings` (simulator and drivers), `host_model` (estimator), `observer`, `effects` (in the
simulator) and `known_effects` (to the host).
"""

from stagectl.config.settings.package_settings import driver_settings, eds_path, stage_settings

__all__ = ["driver_settings", "eds_path", "stage_settings"]
