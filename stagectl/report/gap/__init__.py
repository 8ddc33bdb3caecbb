"""The page of a gap diagnosis: one HTML file that opens offline.

`page` fills the template. `charts` and `plane_picture` draw inline SVG; `traces` and `views` say
what is drawn; `moves` is the data of the interactive charts of single moves.
"""

from stagectl.report.gap.page import render_gap_page

__all__ = ["render_gap_page"]
