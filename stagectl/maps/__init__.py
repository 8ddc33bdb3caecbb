"""Friction maps over the table, built from the history, kept in versions, tracked in production.

`model` (a map), `build`, `active` and `places` (in a run), `learning` (rates of change),
`applicable` and `compare` (checks), `place_index` (what is near a place), `snapshot` (for a
replay), `output` (tables, pages, files).
"""

from stagectl.maps.active import ActiveMap as ActiveMap
from stagectl.maps.active import load_active as load_active
from stagectl.maps.active import map_versions as map_versions
from stagectl.maps.applicable import outdated as outdated
from stagectl.maps.applicable import problems as problems
from stagectl.maps.applicable import sites_outside as sites_outside
from stagectl.maps.build import LEAST_SITES as LEAST_SITES
from stagectl.maps.build import TooFewPlaces as TooFewPlaces
from stagectl.maps.build import build_map as build_map
from stagectl.maps.compare import AxisChange as AxisChange
from stagectl.maps.compare import SiteChange as SiteChange
from stagectl.maps.compare import compare as compare
from stagectl.maps.learning import tracking_settings as tracking_settings
from stagectl.maps.model import FrictionMap as FrictionMap
from stagectl.maps.model import MapSite as MapSite
from stagectl.maps.model import MapVersion as MapVersion
from stagectl.maps.model import to_json as to_json
from stagectl.maps.place_index import PlaceIndex as PlaceIndex
from stagectl.maps.places import SITE_RADIUS as SITE_RADIUS
from stagectl.maps.places import TrackedPlaces as TrackedPlaces
from stagectl.maps.snapshot import restore_snapshot as restore_snapshot
from stagectl.maps.snapshot import take_snapshot as take_snapshot
