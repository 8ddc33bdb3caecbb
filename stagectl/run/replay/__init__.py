"""A run again on its recorded bus log; the first frame that the host sends differently is reported.

`rerun` (the run), `bus` (the log as a bus).
"""

from stagectl.run.replay.bus import Difference
from stagectl.run.replay.rerun import ReplayResult, replay

__all__ = ["Difference", "ReplayResult", "replay"]
