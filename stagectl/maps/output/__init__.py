"""Maps to look at and to take along.

`tables` (on a terminal), `report` (a page, with `heat_map` and `trend_chart`), `as_json` and
`export` (for other programs); `surface` is an axis of a map over the whole table.
"""

from stagectl.maps.output.as_json import (
    activation_as_json,
    changes_as_json,
    version_as_json,
    versions_as_json,
)
from stagectl.maps.output.report import draw_maps, write_map_report
from stagectl.maps.output.tables import at_place, changes_table, summary, versions_table

__all__ = [
    "activation_as_json",
    "at_place",
    "changes_as_json",
    "changes_table",
    "draw_maps",
    "summary",
    "version_as_json",
    "versions_as_json",
    "versions_table",
    "write_map_report",
]
