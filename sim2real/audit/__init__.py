"""Whether a recording's channels mean what the machine file says, before any physics is suspected.

`channels` runs the audit: `signal_checks` needs nothing but the logged numbers, `controller_law`
recomputes the force that the drive must have commanded, `law_hypotheses` finds the timing or gain
error that explains the difference, and `corrections` removes it from the recording.
"""

from sim2real.audit.channels import BEYOND, Audit, applied, audit
from sim2real.audit.controller_law import law_of

__all__ = [
    "BEYOND",
    "Audit",
    "applied",
    "audit",
    "law_of",
]
