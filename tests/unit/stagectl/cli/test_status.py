"""`stagectl status` on the virtual stage."""

import json


def test_status_in_words_and_as_json(call):
    failure, out, _ = call("status", "--simulate")
    assert failure == 0
    assert out.count("off, no force") == 2
    failure, out, _ = call("status", "--simulate", "--json", "-")
    status = json.loads(out)
    assert list(status) == ["x", "y"]
    assert status["y"]["state"] == "SWITCH ON DISABLED"
    assert status["y"]["error_history"] == []
    assert (status["y"]["sto"], status["y"]["brake"]) == (False, True)
    assert status["y"]["words"] == "off, no force; brake set"
