"""Whether a recording's channels mean what the machine file says, before any physics is suspected.

`sample_repair` comes first: rows that the log lost, values that it repeated. `channels` runs the
audit: `signal_checks` needs nothing but the logged numbers, `controller_law`
recomputes the force that the drive must have commanded, `law_hypotheses` finds the timing or gain
error that explains the difference, and `corrections` removes it from the recording.
"""

from sim2real.audit.channels import UNCORRECTABLE, audit_channels, delay_finding, mark_applied
from sim2real.audit.corrections import remove_delay
from sim2real.audit.sample_repair import repair_samples
from sim2real.audit.signal_checks import check_quantisation, check_time

__all__ = [
    "UNCORRECTABLE",
    "audit_channels",
    "check_quantisation",
    "check_time",
    "delay_finding",
    "mark_applied",
    "remove_delay",
    "repair_samples",
]
