"""What a machine can is said of every machine, and what it lacks comes with a remedy."""

import json

from click.testing import CliRunner

from stagectl.cli.doctor import command
from stagectl.doctor import NAMES
from stagectl.errors import StagectlError


def test_everything_is_examined_in_order_and_what_is_missing_has_a_remedy(findings):
    assert tuple(one.name for one in findings) == NAMES
    for one in findings:
        assert one.found
        assert one.available or one.remedy, one.name


def test_what_is_required_and_missing_fails(findings):
    names = [one.name for one in findings if not one.available]
    required = [word for name in NAMES for word in ("--require", name)]
    done = CliRunner().invoke(command, ["--seconds", "0.1", "--json", "-", *required])
    found = json.loads(done.stdout)["findings"]
    missing = [one["name"] for one in found if not one["available"]]
    assert set(missing) - {"jitter"} == set(names) - {"jitter"}
    if missing:
        assert isinstance(done.exception, StagectlError)
        assert str(done.exception) == f"this machine lacks {', '.join(missing)}"
    else:
        assert done.exit_code == 0
