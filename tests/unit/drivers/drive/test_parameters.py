"""Which values of a drive are accepted in place of the requested ones, and what is said of them."""

import pytest

from drivers import objects as od
from drivers.drive.parameters import Parameter, Rule, write_profile, write_settings
from drivers.errors import ConfigurationError

READ_ONLY, ABSENT = 0x06010002, 0x06020000


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


def test_the_host_goes_on_with_the_values_that_the_drive_holds(stage, scripted, axis_settings):
    held = scripted.drives[0].objects
    for place, value in {
        (0x6065, 0): 500_000, (0x6072, 0): 2000, (0x607D, 1): 2**32 - 100_000_000,
        (0x607D, 2): 120_000_000,
    }.items():  # fmt: skip
        held[place] = value
        scripted.drives[0].stuck.add(place)
    settings, clauses = write_settings(stage.axes[0].node, axis_settings[0])
    assert settings.following_error == pytest.approx(5e-4)
    assert settings.peak_force == pytest.approx(80.0)
    assert settings.travel == pytest.approx((-0.1, 0.12))
    assert settings.velocity == axis_settings[0].velocity
    assert [c.split(" is ")[0] for c in clauses] == [
        "0x6065:00 following error window", "0x6072:00 max torque",
        "0x607D:01 min position limit", "0x607D:02 max position limit",
    ]  # fmt: skip


def test_more_force_than_requested_is_refused(stage, scripted, axis_settings):
    scripted.drives[0].objects[0x6072, 0] = 4000
    scripted.drives[0].stuck.add((0x6072, 0))
    with pytest.raises(
        ConfigurationError, match="0x6072:00 max torque: wrote 3000, the drive holds 4000"
    ):
        write_settings(stage.axes[0].node, axis_settings[0])


def test_missing_objects_are_reported_where_they_have_a_consequence(stage, scripted, axis_settings):
    for index, sub in ((0x6065, 0), (0x605A, 0), (0x607D, 2), (0x6067, 0), (0x605B, 0)):
        scripted.drives[0].refuse[index, sub] = ABSENT
    _, clauses = write_settings(stage.axes[0].node, axis_settings[0])
    assert [c.split(": ")[1] for c in clauses] == [
        "its reaction to a quick stop is manufacturer specific",
        "the drive does not monitor the following error as requested",
        "only the host monitors the travel",
    ]


@pytest.mark.parametrize(
    ("held", "reaction"),
    [
        (0, "it switches the power off and the axis coasts, nothing brakes it"),
        (6, "it brakes on the quick-stop ramp and holds there"),
        (-2 & 0xFFFF, "the reaction is manufacturer specific"),
    ],
)
def test_another_reaction_to_a_quick_stop_is_spelled_out(
    stage, scripted, axis_settings, held, reaction
):
    scripted.drives[0].objects[0x605A, 0] = held
    scripted.drives[0].stuck.add((0x605A, 0))
    (clause,) = write_settings(stage.axes[0].node, axis_settings[0])[1]
    assert clause.endswith(f"on a quick stop, also when the host is lost, {reaction}")


def test_a_slower_profile_tells_how_much_longer_moves_take(stage, scripted, axis_settings):
    drive = scripted.drives[0]
    unit = axis_settings[0].velocity_unit_si
    drive.objects[0x6081, 0] = round(0.05 / unit)
    drive.stuck.add((0x6081, 0))
    slower, clauses = write_profile(stage.axes[0].node, axis_settings[0], 0.2, 5.0)
    assert slower == pytest.approx(4.0)
    assert clauses[od.PROFILE_ACCELERATION] is clauses[od.PROFILE_DECELERATION] is None
    assert (clauses[od.PROFILE_VELOCITY] or "").endswith(
        "is 0.05 m/s, not 0.2 m/s: the move takes longer"
    )


def test_a_profile_needs_its_velocity_object(stage, scripted, axis_settings):
    scripted.drives[0].refuse[0x6081, 0] = ABSENT
    with pytest.raises(ConfigurationError, match=r"axis x: 0x6081:00 .*is not offered"):
        write_profile(stage.axes[0].node, axis_settings[0], 0.2, 5.0)
