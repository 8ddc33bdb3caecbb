"""A summary from a recording alone: limits, interruption, and what is not of this version."""

import json
import shlex
from dataclasses import replace
from pathlib import Path

import pytest

from stagectl.config import load_machine, parse_machine
from stagectl.errors import UnusableInput
from stagectl.run import execute
from stagectl.run.recorded.documents import read_run
from stagectl.run.recorded.summarise import resume_command, run_note, site_verdicts, summarise
from stagectl.sequencer import SegmentDone, SiteVerdict
from tests.short_recipe import short_recipe
from tests.unit.stagectl.run.whole import request_for, stopping_at

PLACES = ((0.004, 0.0), (0.008, 0.0), (0.004, 0.004))


@pytest.fixture(scope="module")
def stopped(machine, tmp_path_factory):
    """Notes and recording of a run of three sites, stopped when two were done."""
    folder = tmp_path_factory.mktemp("stopped")
    text = short_recipe(*PLACES) + "limits: {settling: 10 s}\n"
    execute(request_for(machine, folder / "run", text), stopping_at(SegmentDone, 2))
    path = folder / "run" / "recording.h5"
    return (*read_run(path), path)


def summary_of(stopped, change=lambda event: event, **other):
    """The summary after each event has been changed, or left out (None)."""
    notes, recording, machine, path = stopped
    events = [changed for event in notes.events if (changed := change(dict(event))) is not None]
    return summarise(replace(notes, events=tuple(events), **other), recording, None, machine, path)


def changing(name, **values):
    return lambda event: {**event, **values} if event["event"] == name else event


def without(*names):
    return lambda event: None if event["event"] in names else event


def test_it_is_what_the_run_wrote(stopped):
    *_, path = stopped
    written = json.loads((path.parent / "summary.json").read_text())
    made = json.loads(json.dumps(summary_of(stopped)))
    assert list(made) == [key for key in written if key != "punctuality"]
    assert list(made)[:17] == [
        "format", "version", "recipe", "machine", "compensation", "seed", "simulated", "lot",
        "duration", "wall_time", "outcome", "fault", "moves", "friction", "micro", "macro", "cycle",
    ]  # fmt: skip
    for key in ("moves", "friction", "limits"):
        assert made[key] == written[key]


def test_an_estimate_has_units_and_null_for_what_is_unknown(stopped):
    figures = {"parameters": {"coulomb": [6.0, None]}, "gain": {"coulomb": float("inf")}}
    change = changing("friction", **figures, compute_time=None, held=["viscous"])
    entry = summary_of(stopped, change)["friction"][0]
    assert entry["parameters"] == {"coulomb": {"value": 6.0, "sigma": None, "unit": "N"}}
    assert (entry["gain"], entry["compute_time"]) == ({"coulomb": None}, None)
    assert entry["held"] == ["viscous"]


def test_what_the_run_met_on_its_way_is_listed(stopped):
    notes, *rest = stopped
    step = {"axis": "x", "place": [0.0, 0.0], "time": 3.0, "change": 0.2, "everywhere": False}
    found = {"axis": "y", "time": 1.0, "out": True, "text": "it fed"}
    retry = {"site": 2, "attempt": 1, "fault": "0x8611"}
    unfiled = {"filed": 1, "estimates": 3}
    named = {"level_stepped": step, "observer_found": found, "retry": retry, "unfiled": unfiled}
    events = [{"event": name, "sample": 0, **of} for name, of in named.items()]
    made = summary_of((replace(notes, events=(*notes.events, *events)), *rest))
    assert (made["steps"], made["watchdog"], made["retries"]) == ([step], [found], [retry])
    assert made["history"] == unfiled


def test_only_completed_sites_are_judged(stopped):
    limits = summary_of(stopped)["limits"]
    assert (limits["verdict"], limits["passed"], limits["failed"]) == ("incomplete", 2, 0)
    assert [site["site"] for site in limits["sites"]] == [1, 2]
    assert site_verdicts(summary_of(stopped)) == (SiteVerdict(1, ()), SiteVerdict(2, ()))


def test_verdicts_of_the_run_before_complete_those_of_this_one(stopped):
    before = {"run": "/a", "started": "t", "done": 1, "friction": {}}

    def verdict(failures):
        resumed = {**before, "verdicts": [[3, failures]]}
        return summary_of(stopped, changing("run", resumed=resumed))["limits"]["verdict"]

    assert verdict([]) == "pass"
    assert verdict(["settling"]) == "fail"


def test_a_recipe_without_limits_gets_no_verdict(stopped):
    none = {"settling": None, "peak_error": None, "window": 5e-8}
    assert "limits" not in summary_of(stopped, changing("run", limits=none))
    assert site_verdicts({}) == ()


def test_an_interrupted_run_says_why_where_and_how_to_continue(stopped):
    found = summary_of(stopped)["interrupted"]
    assert found["reason"] == "stopped by the operator"
    assert (found["unit"], found["done"], found["of"], found["at"]) == ("site", 2, 3, 3)
    assert f"--resume {stopped[-1].parent}" in found["resume"]


def test_the_reason_is_the_fault_the_stop_or_the_end_of_the_process(stopped):
    fault = summary_of(stopped, outcome="fault", fault="axis y: 0x8611")
    assert fault["interrupted"]["reason"] == "axis y: 0x8611"
    killed = summary_of(stopped, without("end"), outcome="killed")
    assert killed["interrupted"]["reason"] == "the process was killed"
    assert killed["wall_time"] is None
    assert "interrupted" not in summary_of(stopped, outcome="completed")


def test_a_site_that_has_begun_is_where_the_run_was(stopped):
    second = [event for event in stopped[0].events if event["event"] == "done"][1]

    def change(event):
        return None if event == second else event

    found = summary_of(stopped, change)["interrupted"]
    assert (found["done"], found["at"]) == (1, 2)


def test_other_recordings_are_refused_in_one_line(stopped):
    notes, path = stopped[0], Path("a.h5")
    for events in ((), ({"event": "run"},)):
        with pytest.raises(UnusableInput, match=r"^a\.h5: does not say how it was run"):
            run_note(replace(notes, events=events), path)
    assert run_note(notes, path)["unit"] == "site"


@pytest.mark.parametrize(
    ("event", "damage"),
    [
        ("friction", {"parameters": {"coulomb": 6.0}}),
        ("friction", {"parameters": {"colour": [1.0, 2.0]}}),
        ("done", {"number": "two"}),
        ("run", {"limits": {}}),
        ("run", {"history": None}),
    ],
)
def test_damaged_events_are_refused_in_one_line(stopped, event, damage):
    with pytest.raises(UnusableInput, match=r"recording\.h5: /events: damaged \("):
        summary_of(stopped, changing(event, **damage))


PACKAGED = "wafer-xy.yaml (packaged)"
BESIDE = str(Path("runs/stage.db").absolute())


def note(**changes):
    files = {"recipe": "r.yaml", "machine": PACKAGED, "truth": PACKAGED}
    plain = {
        "files": files, "simulated": True, "calibration": False, "seed": 1, "bus": None,
        "compensation": "estimated", "friction_scale": 1.0, "retries": 0,
        "history": {"where": BESIDE},
    }  # fmt: skip
    files.update(changes.pop("files", {}))
    return {**plain, **changes}


def command(machine=None, folder="runs/a", **changes):
    return resume_command(note(**changes), machine or load_machine(), folder)


def test_a_plain_run_needs_its_recipe_and_its_folder():
    assert command() == "stagectl run r.yaml --simulate --resume runs/a"


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"seed": 4}, "--seed 4"),
        ({"files": {"machine": "m.yaml", "truth": "m.yaml"}}, "--machine m.yaml --simulate"),
        ({"files": {"truth": "worn.yaml (packaged)"}}, "--simulate worn"),
        ({"compensation": "none"}, "--compensation none"),
        ({"friction_scale": 0.5}, "--friction-scale 0.5"),
        ({"retries": 2}, "--retries 2"),
        ({"use_map": False}, "--map none"),
        ({"observer": False}, "--no-observer"),
        ({"history": {"where": "h.db"}}, "--history h.db"),
        ({"history": {"where": None}}, "--history none"),
    ],
)
def test_what_was_asked_for_is_asked_for_again(changes, words):
    assert f" {words} " in command(**changes)


def test_a_calibration_is_continued_as_one():
    said = command(calibration=True, observer=False)
    assert said == "stagectl calibrate r.yaml --simulate --resume runs/a"


def test_a_real_run_names_its_bus_and_no_seed():
    said = command(simulated=False, bus=["socketcan", "can0"], seed=9)
    assert said == "stagectl run r.yaml --bus socketcan:can0 --resume runs/a"


def test_a_servers_password_is_in_neither_and_makes_no_option():
    text = load_machine().text + "history: postgresql://lab:s3cret@db/stage\n"
    machine = parse_machine(text, "m.yaml")
    history = {"where": "postgresql://lab@db/stage"}
    said = command(machine, simulated=False, files={"machine": "m.yaml"}, history=history)
    assert said == "stagectl run r.yaml --machine m.yaml --resume runs/a"


def test_names_with_blanks_survive_the_shell():
    said = command(folder="runs/my wafer", files={"recipe": "it's.yaml"})
    words = "stagectl run it's.yaml --simulate --resume".split()
    assert shlex.split(said) == [*words, "runs/my wafer"]
