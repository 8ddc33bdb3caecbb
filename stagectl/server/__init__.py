"""The stage server: one process that owns the bus and the stage, and serves many clients.

Two threads. The stage's (`keeper`) owns the bus, does one thing at a time (`motions`, a run) and
holds the axes meanwhile; it hands over samples and events and waits for nobody. The other (`api`)
talks to clients, `handlers` answers each request, and all that they see is kept there: `service`
(the state, and what must hold), `jobs`, `command_lease`, `run_queue` (on disk), `running` (a run
from its entry to its files), `notices` and alarms, `snapshot` (the published state). Between them:
`handover`.
"""
