"""What this machine can: one finding for each thing that a stage or a simulation asks of it."""

from stagectl.doctor.examination import NAMES as NAMES
from stagectl.doctor.examination import Finding as Finding
from stagectl.doctor.examination import examine as examine
from stagectl.doctor.examination import jitter_warning as jitter_warning
