"""For whoever connects a stage: who is on the bus, what the axes do, how a drive behaves."""
