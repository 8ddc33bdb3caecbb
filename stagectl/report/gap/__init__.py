"""What gaps and their diagnoses say, and the page of a diagnosis, which opens offline.

`outline` builds it, `page` fills the template. `traces` and `views` say what is drawn; `moves` is
the data of the charts of single moves.
"""

from stagectl.report.gap.outline import diagnosis_outline, gap_section, repeat_lines
from stagectl.report.gap.page import render_gap_page

__all__ = ["diagnosis_outline", "gap_section", "render_gap_page", "repeat_lines"]
