"""How punctual this machine is: what is measured, and what is said of it."""

import re

from stagectl.doctor.timing import LATE, PERIOD, TOLERATED, examine_jitter, examine_scheduling


def test_jitter_is_of_as_many_periods_as_fit_and_its_verdict_follows_from_it():
    found = examine_jitter(0.05)
    count = int(re.search(r"worst of (\d+)", found.found)[1])
    late = int(re.search(r"(\d+) more than half a period", found.found)[1])
    assert count == round(0.05 / PERIOD)
    assert found.available is (late <= TOLERATED * count)
    assert bool(found.remedy) is (late > 0)
    worst = float(re.search(r"([\d-]+) µs \(worst", found.found)[1])
    assert (worst > LATE * PERIOD * 1e6 - 1.0) or late == 0


def test_what_is_not_granted_has_a_remedy():
    found = examine_scheduling()
    assert bool(found.remedy) is not found.available
    assert found.found
