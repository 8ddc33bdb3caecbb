"""The virtual stage: simulated mechanics, CiA 402 drives and the bus they are on.

`VirtualStage` is the plant with its drives, `World` a bus in virtual time, `serve` a stage on any
python-can bus in real time, `simulate` the plant without a bus. A name is imported when it is first
used, so that `import hil_sim.settings` loads neither numba nor CAN.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hil_sim.bus import FaultPlan, FaultyWorld, InjectedFault, LockstepBus, World, serve
    from hil_sim.cia301 import CSP_DCF_PATH, EDS_PATH
    from hil_sim.drive import Drive
    from hil_sim.effects import AppliedEffect, Effect, Parameter
    from hil_sim.plant import Plant, Response, simulate
    from hil_sim.ports import CanSegment, PlantPort
    from hil_sim.quirks import Quirks
    from hil_sim.settings import (
        AxisSettings,
        CascadeSettings,
        ControlSettings,
        StageSettings,
    )
    from hil_sim.stage import VirtualStage

__all__ = [
    "CSP_DCF_PATH",
    "EDS_PATH",
    "AppliedEffect",
    "AxisSettings",
    "CanSegment",
    "CascadeSettings",
    "ControlSettings",
    "Drive",
    "Effect",
    "FaultPlan",
    "FaultyWorld",
    "InjectedFault",
    "LockstepBus",
    "Parameter",
    "Plant",
    "PlantPort",
    "Quirks",
    "Response",
    "StageSettings",
    "VirtualStage",
    "World",
    "serve",
    "simulate",
]

_HOMES = {
    **dict.fromkeys(("CSP_DCF_PATH", "EDS_PATH"), "cia301"),
    "Drive": "drive",
    "Quirks": "quirks",
    "VirtualStage": "stage",
    **dict.fromkeys(("AppliedEffect", "Effect", "Parameter"), "effects"),
    **dict.fromkeys(("CanSegment", "PlantPort"), "ports"),
    **dict.fromkeys(("Plant", "Response", "simulate"), "plant"),
    **dict.fromkeys(
        ("FaultPlan", "FaultyWorld", "InjectedFault", "LockstepBus", "World", "serve"), "bus"
    ),
}


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module 'hil_sim' has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"hil_sim.{_HOMES.get(name, 'settings')}"), name)
