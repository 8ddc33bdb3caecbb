"""Redirected moves on scripted drives: which bits, what is refused, and where targets end."""

import dataclasses

import pytest

from drivers.drive import Control
from drivers.errors import AxisFault, ConfigurationError, LimitError
from drivers.stage import Stage


@pytest.fixture
def words(stage, acknowledging):
    stage.enable()
    return acknowledging()


@pytest.fixture
def moves(stage, words):
    with stage.profile_moves(0.1, 1.0) as moves:
        yield moves


def edges(words):
    """Targets, and bits 5, 6 and 9, of every rising edge of bit 4."""
    bits = int(Control.CHANGE_IMMEDIATELY | Control.RELATIVE | Control.CHANGE_ON_SETPOINT)
    return [(target, word & bits) for word, target in words if word & Control.NEW_SETPOINT]


def test_the_first_target_takes_effect_at_once_even_if_queued(moves, words):
    moves.to("x", 1e-3, queued=True)
    moves.to("x", 2e-3, queued=True)
    moves.to("x", 3e-3, passing=True)
    moves.to("x", 4e-3)
    now, passing = int(Control.CHANGE_IMMEDIATELY), int(Control.CHANGE_ON_SETPOINT)
    assert edges(words) == [
        (1_000_000, now), (2_000_000, 0), (3_000_000, passing), (4_000_000, now),
    ]  # fmt: skip


def test_relative_targets_count_from_the_previous_one(moves, words):
    moves.to("x", 1e-3)
    moves.to("x", 0.5e-3, relative=True)
    assert edges(words)[-1] == (
        500_000, int(Control.CHANGE_IMMEDIATELY | Control.RELATIVE),
    )  # fmt: skip
    with pytest.raises(LimitError, match=r"^axis x: "):
        moves.to("x", 0.149, relative=True)  # from 1.5 mm: beyond 150 mm


POSITIONING_OPTION = """
[60F2]
ParameterName=Positioning option code
ObjectType=0x7
DataType=0x0006
AccessType=rw
PDOMapping=0
"""


def test_a_drive_that_counts_relative_targets_from_elsewhere_is_refused(
    scripted, bus_settings, axis_settings, acknowledging, tmp_path
):
    eds = tmp_path / "drive.eds"
    eds.write_text(axis_settings[0].eds.read_text() + POSITIONING_OPTION)
    axes = tuple(dataclasses.replace(axis, eds=eds) for axis in axis_settings)
    drive = scripted.drives[0]
    with Stage.open(bus_settings, axes, bus_object=scripted) as stage:
        stage.boot()
        stage.enable()
        words = acknowledging()
        with stage.profile_moves(0.1, 1.0) as moves:
            drive.objects[0x60F2, 0] = 0x0002  # from the actual position
            with pytest.raises(
                ConfigurationError,
                match=r"^axis x: 0x60F2:00 .*0x0002: relative targets do not count from the prev",
            ):
                moves.to("x", 1e-3, relative=True)
            assert edges(words) == []
            drive.refuse[0x60F2, 0] = 0x06020000  # absent: the standard's default
            moves.to("x", 1e-3, relative=True)
        assert len(edges(words)) == 1


def test_an_unknown_axis_is_named_with_those_there_are(moves):
    with pytest.raises(ConfigurationError, match=r"^axis q: no such axis \(there are x, y\)"):
        moves.to("q", 0.0)


def test_the_profile_is_written_only_where_it_changes(moves, scripted):
    moves.to("x", 1e-3)
    drive = scripted.drives[0]
    drive.writes.clear()
    moves.to("x", 2e-3)
    assert [w for w in drive.writes if w[0] in (0x6081, 0x6083)] == []
    moves.to("x", 3e-3, velocity=0.05)
    assert [i for i, _, _ in drive.writes if i in (0x6081, 0x6083)] == [0x6081]


def test_a_target_that_is_not_reached_in_time_is_named_with_the_actual_position(moves, scripted):
    def on_sync(drive, count):
        word, _, offset = drive.latched
        drive.bits = 1 << 12 if word & Control.NEW_SETPOINT else 0
        drive.latched = (word, 1234, offset)

    scripted.drives[0].on_sync = on_sync
    moves.to("x", 1e-3)
    with pytest.raises(
        AxisFault,
        match=r"^axis x: 0x607A:00 .*target 0\.001 m is not reached within 2\.\d+ s, it is at "
        r"1\.234e-06 m \(statusword 0x0227\)",
    ):
        moves.wait()
    moves.halt()  # so that the end of the block does not wait again
