"""What gaps and their diagnoses say, and the page of a diagnosis, which opens offline.

`outline` builds it, `page` fills the template and has the data of the charts of single moves.
`traces` and `views` say what else is drawn.
"""

from stagectl.report.gap.outline import diagnosis_outline as diagnosis_outline
from stagectl.report.gap.outline import gap_section as gap_section
from stagectl.report.gap.outline import repeat_lines as repeat_lines
from stagectl.report.gap.page import render_gap_page as render_gap_page
