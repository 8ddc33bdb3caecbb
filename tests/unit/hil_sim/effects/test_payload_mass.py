"""Moved mass, against the motion of a free mass."""

from tests.unit.hil_sim.effects.closed_forms import MASS, assert_close, every_step, travelled


@every_step
def test_payload_mass(free, with_effects, effects, pushed, substeps, accuracy):
    stage = with_effects(free, effects["payload_mass"].at(mass=-1.5))
    time, position, _ = pushed(stage, 4.0, substeps=substeps)
    assert_close(position, travelled(time, 4.0, MASS - 1.5), accuracy)
