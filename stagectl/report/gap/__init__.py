"""The page of a gap diagnosis: one HTML file that opens offline.

`page` fills the template. `charts` and `plane_picture` draw inline SVG; `traces` and `views` say
what is drawn; `moves` is the data of the interactive charts of single moves.
"""

from stagectl.report.gap.page import write_gap_page

__all__ = ["write_gap_page"]
