"""The moves proposed to tell two models apart."""

from __future__ import annotations

import numpy as np
import yaml

from hil_sim.effects.library import library
from sim2real.experiment import propose_experiment
from sim2real.fitting import NUISANCES, AxisModel, Term
from sim2real.gap import compare_with_model
from stagectl.config.machine.file import load_machine
from stagectl.recipe import load_recipe


def test_moves_that_would_tell_two_models_apart_are_a_recipe(nominal, tmp_path):
    recording, settings = nominal
    known = library()
    measured = [compare_with_model(recording, settings)]
    plain = {axis.name: AxisModel(np.zeros(NUISANCES)) for axis in settings.axes}
    coupled = {**plain, "y": plain["y"].added(Term(known["cross_coupling"], (0.4,)))}
    asked = propose_experiment("y is pulled", plain, coupled, "y", measured, settings)
    assert asked is not None
    assert asked.why.startswith("y is pulled")
    assert len({move["to"][0] for move in asked.moves if "to" in move}) > 1  # x moves
    path = tmp_path / "next.yaml"
    path.write_text(yaml.safe_dump(asked.recipe()), encoding="utf-8")
    assert load_recipe(path, load_machine()).name == "next-experiment"
    assert propose_experiment("nothing", plain, plain, "y", measured, settings) is None
