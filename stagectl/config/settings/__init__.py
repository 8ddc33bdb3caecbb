"""What a machine file is to the lower packages.

`package_settings` (simulator and drivers), `host_model` (estimator), `observer`, `effects` (in the
simulator) and `known_effects` (to the host).
"""
