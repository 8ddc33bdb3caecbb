"""Maps: written as JSON, read back, and refused where damaged."""

import pytest

from stagectl.errors import UnusableInput
from stagectl.maps import to_json
from stagectl.maps.model import from_json


def test_a_map_survives_its_format_and_damage_is_reported(mapped):
    built = mapped.first.map
    assert from_json(to_json(built), "m") == built
    for text in ("", "[]", "{}", to_json(built)[:-40], to_json(built).replace("gaussian", "x")):
        with pytest.raises(UnusableInput, match="m: not a usable friction map"):
            from_json(text, "m")
    newer = to_json(built).replace('"version": 1', '"version": 9')
    with pytest.raises(UnusableInput, match="newer"):
        from_json(newer, "m")
