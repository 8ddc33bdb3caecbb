"""Friction maps: built from the history, kept in versions, used and tracked in production."""

from stagectl.maps.active import ActiveMap, load_active, map_versions
from stagectl.maps.applicable import outdated, problems, sites_outside
from stagectl.maps.build import build_map
from stagectl.maps.compare import AxisChange, compare
from stagectl.maps.learning import tracking_settings
from stagectl.maps.model import FrictionMap, MapVersion, to_json
from stagectl.maps.places import SITE_RADIUS, TrackedPlaces
from stagectl.maps.plain import applied, changed, listed, shown
from stagectl.maps.report import write_map_report
from stagectl.maps.snapshot import restore_snapshot, take_snapshot
from stagectl.maps.tables import at_place, changes_table, summary, versions_table

__all__ = [
    "SITE_RADIUS",
    "ActiveMap",
    "AxisChange",
    "FrictionMap",
    "MapVersion",
    "TrackedPlaces",
    "applied",
    "at_place",
    "build_map",
    "changed",
    "changes_table",
    "compare",
    "listed",
    "load_active",
    "map_versions",
    "outdated",
    "problems",
    "restore_snapshot",
    "shown",
    "sites_outside",
    "summary",
    "take_snapshot",
    "to_json",
    "tracking_settings",
    "versions_table",
    "write_map_report",
]
