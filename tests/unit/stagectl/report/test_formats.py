"""Figures as text."""

import pytest

from stagectl.report.formats import digits, listed, micrometres, milliseconds, percent, with_sigma


@pytest.mark.parametrize(
    ("metres", "text"),
    [(9e-8, "0.0900"), (5.2e-5, "52.0"), (0.025, "25 000"), (0.0, "0"), (None, "–")],  # noqa: RUF001
)
def test_lengths_have_three_significant_digits(metres, text):
    assert micrometres(metres) == text


@pytest.mark.parametrize(("seconds", "text"), [(0.0, "0"), (0.1435, "143.5"), (0.002, "2")])
def test_times_in_milliseconds(seconds, text):
    assert milliseconds(seconds) == text


def test_very_small_and_large_values_have_exponents():
    assert digits(6e5) == "600 000"
    assert digits(1.234e-5) == "1.23e-05"
    assert digits(float("nan")) == "–"  # noqa: RUF001


def test_a_value_has_the_digits_that_its_sigma_has_a_say_in():
    assert with_sigma(0.05, 0.002) == ("0.0500", "0.0020")
    assert with_sigma(599896.3, 446.0) == ("599 896", "446")


def test_names_as_in_a_sentence():
    assert listed(["a"]) == "a"
    assert listed(["a", "b", "c"]) == "a, b and c"


@pytest.mark.parametrize(
    ("share", "decimals", "text"),
    [
        (1.0, 0, "100 %"), (0.99999999, 0, "100 %"), (0.9962, 0, "99.6 %"), (0.9996, 0, "99.96 %"),
        (0.9996, 1, "99.96 %"), (0.994, 0, "99 %"), (1.004, 0, "100 %"), (0.07, 0, "7 %"),
    ],
)  # fmt: skip
def test_only_all_of_it_is_a_hundred_per_cent(share: float, decimals: int, text: str):
    assert percent(share, decimals) == text
