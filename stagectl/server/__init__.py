"""The stage server: one process that owns the bus and the stage, and serves many clients.

Two threads. The stage's (`keeper`) owns the bus, does one thing at a time (`motions`, a run) and
holds the axes meanwhile; it hands over samples and events and waits for nobody. The other (`api`)
talks to clients, and all that they see is kept there: `service` (what may be asked for when),
`jobs`, `lease`, `run_queue` (on disk), `running` (a run from its entry to its files), `notices`,
`alarms`, `snapshot` (the published state). Between them: `handover`.
"""
