"""The communication profile of a virtual drive (CiA 301): objects, SDO, PDO, NMT, EMCY."""

from hil_sim.cia301.dictionary import CSP_DCF_PATH, EDS_PATH, Dictionary, Value, key
from hil_sim.cia301.emergency import (
    COASTING_FAULTS,
    CONNECTION_ABORTED,
    ENCODER_LOST,
    FOLLOWING_ERROR,
    HARDWARE,
    HEARTBEAT_LOST,
    OVER_CURRENT,
    OVER_TEMPERATURE,
    OVER_TRAVEL,
    OVER_VOLTAGE,
    RPDO_TIMEOUT,
    SYNC_LENGTH,
    UNDER_VOLTAGE,
    Emergency,
)
from hil_sim.cia301.nmt import NmtSlave, NmtState
from hil_sim.cia301.pdo_engine import PdoEngine
from hil_sim.cia301.sdo_server import DriveSdoServer

__all__ = [
    "COASTING_FAULTS",
    "CONNECTION_ABORTED",
    "CSP_DCF_PATH",
    "EDS_PATH",
    "ENCODER_LOST",
    "FOLLOWING_ERROR",
    "HARDWARE",
    "HEARTBEAT_LOST",
    "OVER_CURRENT",
    "OVER_TEMPERATURE",
    "OVER_TRAVEL",
    "OVER_VOLTAGE",
    "RPDO_TIMEOUT",
    "SYNC_LENGTH",
    "UNDER_VOLTAGE",
    "Dictionary",
    "DriveSdoServer",
    "Emergency",
    "NmtSlave",
    "NmtState",
    "PdoEngine",
    "Value",
    "key",
]
