"""What a machine can is said of every machine, and what it lacks comes with a remedy."""

import json
import re

import numpy as np
import pytest
from click.testing import CliRunner

from drivers.settings import RealTimeSettings
from stagectl.cli.doctor import command
from stagectl.doctor import NAMES, examination, jitter_warning
from stagectl.doctor.examination import LATE, PERIOD, TOLERATED, examine_jitter, examine_scheduling
from stagectl.errors import StagectlError


def test_jitter_is_of_as_many_periods_as_fit_and_its_verdict_follows_from_it():
    found = examine_jitter(0.05)
    count = int(re.search(r"worst of (\d+)", found.found)[1])
    late = int(re.search(r"(\d+) more than half a period", found.found)[1])
    assert count == round(0.05 / PERIOD)
    assert found.available is (late <= TOLERATED * count)
    assert bool(found.remedy) is (late > 0)
    worst = float(re.search(r"([\d-]+) µs \(worst", found.found)[1])
    assert (worst > LATE * PERIOD * 1e6 - 1.0) or late == 0


@pytest.mark.parametrize(
    ("late", "said"),
    [
        (0.1e-3, None),
        (0.9e-3, "bus.sync_period: 2 ms"),
        (1.5e-3, "bus.sync_period: 4 ms"),
        (1.0, "none up to"),
    ],
)
def test_a_period_that_this_computer_cannot_keep_is_told_with_one_that_it_can(
    monkeypatch, late, said
):
    monkeypatch.setattr(examination, "_lateness", lambda *_: np.full(100, late))
    line = jitter_warning(1e-3, RealTimeSettings())
    assert line is None if said is None else said in line


def test_what_is_not_granted_has_a_remedy():
    found = examine_scheduling()
    assert bool(found.remedy) is not found.available
    assert found.found


def test_the_kernels_say_where_they_are(findings):
    kernels = findings[0]
    assert kernels.available
    assert "compiled here" in kernels.found


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
