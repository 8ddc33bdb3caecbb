"""Calibration: friction measured at fixed sites, and identified from recordings.

`sites` (the file), `sequence` (moves at a site), `due_sites` (when, and into production),
`execution` (the whole of it), `outcome` and `page` (results), `documents` (results again, from a
recording), `identify` (figures of an axis).
"""

from stagectl.calibration.documents import rewrite_all_documents as rewrite_all_documents
from stagectl.calibration.due_sites import due_now as due_now
from stagectl.calibration.due_sites import due_sites as due_sites
from stagectl.calibration.due_sites import insert_sites as insert_sites
from stagectl.calibration.due_sites import require_enough_sites as require_enough_sites
from stagectl.calibration.execution import calibrate as calibrate
from stagectl.calibration.execution import calibration_as_json as calibration_as_json
from stagectl.calibration.execution import resume_calibration as resume_calibration
from stagectl.calibration.identify import identify_axis as identify_axis
from stagectl.calibration.identify import identify_pieces as identify_pieces
from stagectl.calibration.outcome import ACT as ACT
from stagectl.calibration.outcome import predicted_gains as predicted_gains
from stagectl.calibration.page import calibration_outline as calibration_outline
from stagectl.calibration.sequence import SiteSequence as SiteSequence
from stagectl.calibration.sites import Calibration as Calibration
from stagectl.calibration.sites import DueSection as DueSection
from stagectl.calibration.sites import load_calibration as load_calibration
from stagectl.calibration.sites import parse_calibration as parse_calibration
