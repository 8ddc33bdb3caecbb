"""`stagectl check` on the virtual stage."""

import json
import re


def test_check_passes_on_the_virtual_drive(call):
    failure, out, _ = call("check", 2, "--simulate", "--json", "-")
    assert failure == 0
    findings = json.loads(out)
    assert {f["verdict"] for f in findings} == {"pass"}
    failure, out, _ = call("check", 2, "--simulate", "--no-power", "--failures")
    assert failure == 0
    assert re.search(r"\d+ pass, 0 FAIL, 0 differs, 0 not offered", out)


def test_check_of_nobody_is_one_line(call):
    failure, _, _ = call("check", 9, "--simulate")
    assert str(failure) == "node 9 does not answer SDO"
