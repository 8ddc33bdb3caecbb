"""Whole runs on the virtual stage, and data of another program."""

import shutil
import sys

import numpy as np
import pytest

from hil_sim.bus import faults as f
from hil_sim.plant import simulate
from stagectl.config import load_machine, stage_settings
from stagectl.history import open_history
from stagectl.importing import load_map
from stagectl.recipe import parse_recipe
from stagectl.run import HostSettings, Listener, SimulatedStage, execute
from tests.unit.stagectl.logged_data import EXAMPLE
from tests.unit.stagectl.run.replay.logged import run as run_logged
from tests.unit.stagectl.run.whole import SITES, request_for


@pytest.fixture(scope="session")
def columns():
    """What the example's machine would have logged, in the data's own columns and units."""
    _, machine = load_map(EXAMPLE / "map.yaml")
    settings = stage_settings(machine)
    t = np.arange(3000) * 1e-3
    demand = (0.05 * np.sin(np.pi * t) ** 2)[:, None]
    response = simulate(settings, demand, np.zeros_like(demand), None)
    volts = response.force[:, 0] / 35.15065188248547
    return {
        "t": t, "qg": demand[:, 0], "qm": response.position[:, 0],
        "vir": np.concatenate((volts[1:], volts[-1:])),
    }  # fmt: skip


@pytest.fixture(scope="session")
def machine():
    """The packaged machine."""
    return load_machine()


@pytest.fixture
def history(tmp_path):
    """An empty one, open for writing."""
    opened = open_history(str(tmp_path / "stage.db"), write=True)
    yield opened
    opened.close()


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Install a package of one module, whose objects are plug-ins of a group, for one test."""
    made = []

    def go(name, text, group, **objects):
        (tmp_path / f"{name}.py").write_text(text)
        info = tmp_path / f"{name}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
        points = "".join(f"{point} = {where}\n" for point, where in objects.items())
        (info / "entry_points.txt").write_text(f"[{group}]\n{points}")
        monkeypatch.syspath_prepend(tmp_path)
        made.append(name)

    yield go
    for name in made:
        sys.modules.pop(name, None)


@pytest.fixture
def sites(machine):
    """A recipe of five sites."""
    return parse_recipe(SITES, "short.yaml", machine)


@pytest.fixture(scope="session")
def whole_run(machine, tmp_path_factory):
    """The folder of a run without faults."""
    folder = tmp_path_factory.mktemp("whole") / "run"
    assert run_logged(machine, folder).summary["outcome"] == "completed"
    return folder


@pytest.fixture
def logged(whole_run, tmp_path):
    """A copy of it, whose bus log is replayed, to be changed."""
    return shutil.copytree(whole_run, tmp_path / "run")


@pytest.fixture
def go(machine, tmp_path):
    """Run a recipe on the virtual stage."""

    def run(recipe, folder, *, faults=(), listener=None, scale=1.0, measurement=None, **options):
        plan = f.FaultPlan(tuple(faults), 1) if faults else None
        options["simulated"] = SimulatedStage(machine, faults=plan)
        options["host"] = HostSettings(friction_scale=scale, measurement=measurement)
        request = request_for(machine, tmp_path / folder, recipe=recipe, **options)
        return execute(request, listener or Listener())

    return run
