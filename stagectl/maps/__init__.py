"""Friction maps over the table, built from the history, kept in versions, tracked in production.

`model` (a map), `build`, `active` and `places` (in a run), `learning` (rates of change),
`applicable` and `compare` (checks), `place_index` (what is near a place), `snapshot` (for a
replay), `output` (tables, pages, files).
"""

from stagectl.maps.active import ActiveMap, load_active, map_versions
from stagectl.maps.applicable import outdated, problems, sites_outside
from stagectl.maps.build import LEAST_SITES, TooFewPlaces, build_map
from stagectl.maps.compare import AxisChange, SiteChange, compare
from stagectl.maps.learning import tracking_settings
from stagectl.maps.model import FrictionMap, MapSite, MapVersion, to_json
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
from stagectl.maps.place_index import PlaceIndex
from stagectl.maps.places import SITE_RADIUS, TrackedPlaces
from stagectl.maps.snapshot import restore_snapshot, take_snapshot

__all__ = [
    "LEAST_SITES",
    "SITE_RADIUS",
    "ActiveMap",
    "AxisChange",
    "FrictionMap",
    "MapSite",
    "MapVersion",
    "PlaceIndex",
    "SiteChange",
    "TooFewPlaces",
    "TrackedPlaces",
    "activation_as_json",
    "at_place",
    "build_map",
    "changes_as_json",
    "changes_sections",
    "compare",
    "draw_maps",
    "load_active",
    "map_outline",
    "map_versions",
    "outdated",
    "problems",
    "restore_snapshot",
    "sites_outside",
    "take_snapshot",
    "to_json",
    "tracking_settings",
    "version_as_json",
    "versions_as_json",
    "versions_sections",
    "write_map_page",
]
