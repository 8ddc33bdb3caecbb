"""Maps to look at and to take along.

`outline` (what they say), `page`, `as_json` and `export` (for
other programs); `surface` is an axis of a map over the whole table.
"""

from stagectl.maps.output.as_json import (
    activation_as_json,
    changes_as_json,
    version_as_json,
    versions_as_json,
)
from stagectl.maps.output.outline import (
    at_place,
    changes_sections,
    map_outline,
    versions_sections,
)
from stagectl.maps.output.page import draw_maps, write_map_page

__all__ = [
    "activation_as_json",
    "at_place",
    "changes_as_json",
    "changes_sections",
    "draw_maps",
    "map_outline",
    "version_as_json",
    "versions_as_json",
    "versions_sections",
    "write_map_page",
]
