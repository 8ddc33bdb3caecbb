"""How often something may happen."""

from stagectl.rates import Rates


def test_one_connection_cannot_flood_the_others():
    rates = Rates(500.0, 500.0)
    assert sum(rates.allows(b"a") for _ in range(2000)) < 1000
    assert rates.allows(b"b")


def test_what_was_refused_does_not_count():
    rates = Rates(rate=0.0, burst=2.5)
    assert [rates.allows("a") for _ in range(4)] == [True, True, False, False]
