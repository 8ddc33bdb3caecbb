"""Maps to look at and to take along.

`outline` (what they say), `page`, `as_json` and `export` (for
other programs); `surface` is an axis of a map over the whole table.
"""

from stagectl.maps.output.as_json import activation_as_json as activation_as_json
from stagectl.maps.output.as_json import changes_as_json as changes_as_json
from stagectl.maps.output.as_json import version_as_json as version_as_json
from stagectl.maps.output.as_json import versions_as_json as versions_as_json
from stagectl.maps.output.outline import at_place as at_place
from stagectl.maps.output.outline import changes_sections as changes_sections
from stagectl.maps.output.outline import map_outline as map_outline
from stagectl.maps.output.outline import versions_sections as versions_sections
from stagectl.maps.output.page import draw_maps as draw_maps
from stagectl.maps.output.page import write_map_page as write_map_page
