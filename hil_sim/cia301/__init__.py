"""The communication profile of a virtual drive (CiA 301): objects, SDO, PDO, NMT, EMCY."""

from hil_sim.cia301.emergency import Emergency as Emergency
from hil_sim.cia301.nmt import NmtSlave as NmtSlave
from hil_sim.cia301.nmt import NmtState as NmtState
from hil_sim.cia301.object_dictionary import EDS_PATH as EDS_PATH
from hil_sim.cia301.object_dictionary import Dictionary as Dictionary
from hil_sim.cia301.object_dictionary import Value as Value
from hil_sim.cia301.object_dictionary import key as key
from hil_sim.cia301.object_dictionary import require as require
from hil_sim.cia301.pdo_engine import PdoEngine as PdoEngine
from hil_sim.cia301.sdo_server import DriveSdoServer as DriveSdoServer
