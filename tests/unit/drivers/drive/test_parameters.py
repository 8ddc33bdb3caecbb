"""Which values of a drive are accepted in place of the requested ones, and what is said of them."""

import pytest

from drivers import objects as od
from drivers.drive.parameters import Parameter, Rule, write_settings


@pytest.mark.parametrize(
    ("rule", "wanted", "accepted", "refused"),
    [
        (Rule.EXACT, 37, (37,), (36, 38, 0)),
        (Rule.ROUNDED, 1000, (990, 1010), (989, 1011, 0)),
        (Rule.ROUNDED, 10, (9, 11), (8, 12)),  # one unit, where 1 % is less
        (Rule.ROUNDED, 1, (2,), (0,)),  # 0 turns most of them off
        (Rule.LESS, 1000, (1, 1010), (0, 1011, -5)),
        (Rule.ABOVE, -10_000_000, (-5_000_000, -10_000_010), (-10_000_011,)),
        (Rule.BELOW, 10_000_000, (5_000_000, 10_000_010), (10_000_011,)),
        (Rule.ANY, 5, (0, 999), ()),
    ],
)
def test_accepted_are_rounded_values_and_the_safe_side(rule, wanted, accepted, refused):
    parameter = Parameter(od.MAX_FORCE, wanted, rule)
    assert [v for v in accepted if not parameter.is_accepted(v)] == []
    assert [v for v in refused if parameter.is_accepted(v)] == []


def test_a_value_is_described_in_its_si_unit_with_its_consequence():
    window = Parameter(od.FOLLOWING_ERROR_WINDOW, 1_000_000, Rule.LESS, 1e-9, "m", "sooner")
    assert window.describe(500_000) == (
        "0x6065:00 following error window is 0.0005 m, not 0.001 m: sooner"
    )
    # a difference that six digits do not show is shown with ten
    assert window.describe(999_999).endswith("is 0.000999999 m, not 0.001 m: the drive rounds it")
    travel = Parameter(od.SOFT_LIMIT_HIGH, 150_000_000, Rule.BELOW, 1e-9, "m", "beyond")
    assert "is 0.149999999 m, not 0.15 m: the drive rounds it" in travel.describe(149_999_999)


def test_missing_objects_are_reported_where_they_have_a_consequence(stage, scripted, axis_settings):
    for index, sub in ((0x6065, 0), (0x605A, 0), (0x607D, 2), (0x6067, 0), (0x605B, 0)):
        scripted.drives[0].refuse[index, sub] = 0x06020000  # absent
    _, clauses = write_settings(stage.axes[0].node, axis_settings[0])
    assert [c.split(": ")[1] for c in clauses] == [
        "its reaction to a quick stop is manufacturer specific",
        "the drive does not monitor the following error as requested",
        "only the host monitors the travel",
    ]
