"""The command that continues a run: its options again, no default spelled out."""

import shlex
from pathlib import Path

import pytest

from stagectl.config import load_machine, parse_machine
from stagectl.run.recorded.resume_command import resume_command

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
