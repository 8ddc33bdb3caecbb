"""Whether a recording's channels mean what the machine file says, before any physics is suspected.

`sample_repair` comes first: rows that the log lost, values that it repeated. `channels` runs the
audit: `signal_checks` needs nothing but the logged numbers, `controller_law`
recomputes the force that the drive must have commanded, `law_hypotheses` finds the timing or gain
error that explains the difference, and `corrections` removes it from the recording.
"""

from sim2real.audit.channels import UNCORRECTABLE as UNCORRECTABLE
from sim2real.audit.channels import audit_channels as audit_channels
from sim2real.audit.channels import delay_finding as delay_finding
from sim2real.audit.channels import mark_applied as mark_applied
from sim2real.audit.corrections import remove_delay as remove_delay
from sim2real.audit.sample_repair import repair_samples as repair_samples
from sim2real.audit.signal_checks import check_position as check_position
from sim2real.audit.signal_checks import check_quantisation as check_quantisation
from sim2real.audit.signal_checks import check_time as check_time
