"""`stagectl bus-budget` of the packaged stage."""

import json

from stagectl.errors import StagectlError


def test_bus_budget_of_the_stage(call):
    failure, out, _ = call("bus-budget", "--json", "-")
    assert failure == 0
    assert json.loads(out)["bits_worst"] == 595
    failure, out, _ = call("bus-budget", "--tpdo", 8, "--tpdo", 8, "--bitrate", 500_000)
    assert isinstance(failure, StagectlError)
    assert "shortest SYNC period" in out
