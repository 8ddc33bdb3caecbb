"""A run's request as the note that resumes and replays it."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from stagectl.config import load_machine
from stagectl.recipe import parse_recipe
from stagectl.run import HostSettings, Remarks, Resumed, SimulatedStage
from stagectl.sequencer import Mode, SiteVerdict
from tests.unit.stagectl.run.whole import SITES, request_for

MACHINE = load_machine()
RECIPE = parse_recipe(SITES, "short.yaml", MACHINE)
RESUMED = Resumed(
    "runs/a", "2026-11-22T08:00:00+00:00", 7, {"x": {"coulomb": (6.1, 0.05)}},
    (SiteVerdict(1, ()), SiteVerdict(2, ("settling",))),
)  # fmt: skip


def request(**changes):
    of = {"recipe": RECIPE, "simulated": SimulatedStage(MACHINE, 3), **changes}
    return request_for(MACHINE, Path("runs/b"), **of)


def test_an_interrupted_run_comes_back_from_its_note_as_json():
    note = json.loads(json.dumps(RESUMED.as_note()))
    assert Resumed.from_note(note) == RESUMED
    assert RESUMED.link() == {"run": "runs/a", "started": RESUMED.started, "done": 7}


def test_a_continuation_keeps_the_remarks_that_it_is_not_given_anew():
    before = replace(RESUMED, remarks=Remarks("Ada", "first of the lot"))
    assert Remarks("Grace").or_of(before) == Remarks("Grace", "first of the lot")
    assert Remarks("Grace").or_of(None) == Remarks("Grace")


def test_a_note_without_verdicts_is_of_a_recipe_without_limits():
    note = {key: value for key, value in RESUMED.as_note().items() if key != "verdicts"}
    assert Resumed.from_note(note).verdicts == ()


@pytest.mark.parametrize("spoil", [{"done": "many"}, {"friction": {"x": {"coulomb": [1.0]}}}])
def test_a_damaged_note_is_not_taken(spoil):
    with pytest.raises((ValueError, IndexError)):
        Resumed.from_note({**RESUMED.as_note(), **spoil})


def test_the_note_has_what_the_recipe_counts_and_limits():
    note = json.loads(json.dumps(request(resumed=RESUMED).as_note()))
    assert (note["unit"], note["stretches"], note["calibration"]) == ("site", 5, False)
    assert note["limits"]["window"] == RECIPE.settle.window
    assert (note["seed"], note["compensation"], note["simulated"]) == (3, "estimated", True)
    assert note["resumed"]["done"] == 7
    assert note["files"]["recipe"] == "short.yaml"


def test_the_truth_goes_into_the_note_only_where_the_host_knew_it():
    assert request().as_note()["truth"] is None
    assert request(host=HostSettings(Mode.ORACLE)).as_note()["truth"] == MACHINE.text
    real = request(simulated=None, bus=("socketcan", "can0")).as_note()
    assert (real["simulated"], real["truth"], real["files"]["truth"]) == (False, None, None)
    assert real["bus"] == ["socketcan", "can0"]
