"""What this machine can: one finding for each thing that a stage or a simulation asks of it."""

from stagectl.doctor.examination import examine
from stagectl.doctor.finding import NAMES, Finding

__all__ = ["NAMES", "Finding", "examine"]
