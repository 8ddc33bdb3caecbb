"""The virtual drives' bus: lock-step in virtual time, faults, any python-can bus in real time."""
