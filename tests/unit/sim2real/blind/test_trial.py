"""What a trial takes out of the library, and what of the second run it compares."""

from dataclasses import replace

from hil_sim.effects.library import library
from sim2real.blind.trial import is_same, only_within


def test_an_equation_goes_with_all_its_names():
    known = library()
    same = {name for name, effect in known.items() if is_same(effect, known["force_ripple"])}
    assert same == {"force_ripple", "torque_ripple"}
    assert not is_same(known["cogging"], known["cable_stiffness"])


def test_samples_beyond_the_other_run_do_not_count(nominal):
    recording, _ = nominal
    x = recording.axes["x"]
    shorter = x.position_actual <= 0.0
    assert (x.valid & ~shorter).any()
    first = replace(recording, axes={**recording.axes, "x": replace(x, valid=x.valid & shorter)})
    inside = only_within(recording, first)
    top = x.position_actual[x.valid & shorter].max()
    assert (inside.axes["x"].valid == x.valid & (x.position_actual <= top)).all()
    assert (inside.axes["y"].valid == recording.axes["y"].valid).all()
