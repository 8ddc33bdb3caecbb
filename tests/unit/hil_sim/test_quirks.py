"""Odd drives: when and how force offsets act, which position SYNC samples."""

from dataclasses import replace

import numpy as np
import pytest

from hil_sim.plant import simulate
from hil_sim.quirks import OddPosition, Quirks
from hil_sim.settings import StageSettings
from tests.unit.hil_sim.inputs import change_axes, smooth_demand

PERMILLE = 0.04
FORCES = [10, -20, 7, 0, 30, 30, 30, 30]


@pytest.fixture(scope="module")
def stage_settings(stage_settings, request):
    """Its axis x with the quirks that a test asks for."""
    first, second = stage_settings.axes
    return StageSettings(1e-3, (replace(first, quirks=request.param), second))


def sent(host, plant, forces):
    """What the plant is commanded when these are sent, with the target at rest [1/1000 rated]."""
    plant.commands.clear()
    for force in forces:
        host.cycle(0, force=force)
    return [round(force / PERMILLE, 6) for _, axis, _, force, _ in plant.commands if axis == 0]


@pytest.mark.parametrize(
    ("stage_settings", "acting"),
    [
        (Quirks(offset_delay=3), [0, 0, 0, 10, -20, 7, 0, 30]),
        (Quirks(offset_sign=-1), [-10, 20, -7, 0, -30, -30, -30, -30]),
        (Quirks(offset_step=0.0125), [12.5, -25, 12.5, 0, 25, 25, 25, 25]),
    ],
    indirect=["stage_settings"],
)
def test_offsets_act_otherwise_than_sent(streaming, plant, acting):
    assert sent(streaming, plant, FORCES) == acting


@pytest.mark.parametrize("stage_settings", [Quirks(offset_delay=3)], indirect=True)
def test_what_has_not_acted_yet_goes_with_the_power(streaming, plant):
    sent(streaming, plant, [30, 30, 30])
    for word in (0x06, 0x07, 0x0F):
        streaming.cycle(0, word=word)
    assert sent(streaming, plant, [0, 0, 0, 5, 0, 0]) == [0, 0, 0, 0, 0, 0]


@pytest.mark.parametrize("stage_settings", [Quirks(position_delay=1)], indirect=True)
def test_sync_samples_an_old_position_and_sdo_reads_the_present_one(streaming):
    targets = [0, 1000, 3000, 6000, 6000, 6000]
    positions = [position for _, position, _ in streaming.stream(targets)]
    # the following plant reaches a target by the next SYNC
    assert positions[2:] == [0, 1000, 3000, 6000]
    assert streaming.read_object(1, 0x6064, 0, "i") == 6000


def test_a_filtered_position_is_late_by_its_time_constant():
    filtered = OddPosition(Quirks(position_filter=0.3e-3))
    shown = [filtered.sample(10_000 * k, k * 1_000_000) for k in range(30)]
    assert np.diff(shown)[-5:].tolist() == [10_000] * 5
    assert shown[-1] == 290_000 - 3_000
    assert filtered.sample(0, 10**10) == 0  # after a pause nothing is known


def test_the_loop_inside_the_drive_is_not_touched(nominal):
    odd = change_axes(nominal, quirks=Quirks(position_delay=2))
    demand = smooth_demand(1)
    plain, same = (simulate(s, demand, 0.0 * demand, 1) for s in (nominal, odd))
    assert np.array_equal(plain.position, same.position)


@pytest.mark.parametrize(
    "quirks", [{"offset_sign": 0}, {"offset_delay": -1}, {"position_filter": float("nan")}]
)
def test_impossible_quirks_are_refused(quirks):
    with pytest.raises(ValueError, match=next(iter(quirks))):
        Quirks(**quirks)


def test_an_encoder_on_the_load_reads_the_load(nominal, with_effects, effects):
    """A step of force: for half a period of a weak spring the carriage moves and the load waits."""
    stage = with_effects(
        nominal, effects["resonance"].at(frequency=5.0, damping=0.01, mass_ratio=0.3)
    )
    x = stage.axes[0]
    free = replace(x.control, kp=1.0, ki=0.0, kd=0.0)
    there, load = (
        replace(stage, axes=(replace(x, control=free, encoder_on_load=on), stage.axes[1]))
        for on in (False, True)
    )
    demand, force = np.zeros((20, 2)), np.full((20, 2), 20.0)
    force[0] = 0.0
    carriage, behind = (simulate(s, demand, force, None).position[-1, 0] for s in (there, load))
    assert carriage > 1e-4
    assert behind < 0.1 * carriage
