"""What a machine file leaves unknown: found by a diagnosis, refused by everything else."""

import re

import pytest

from stagectl.config import load_machine, parse_machine, stage_settings
from stagectl.errors import ConfigError

TEXT = load_machine().text


def with_unknown(key, text=TEXT):
    """The machine file with the value of this key of axis x unknown."""
    return re.sub(rf"(?m)^( +{key}:).*$", r"\1 unknown", text, count=1)


@pytest.mark.parametrize("key", ["mass", "coulomb", "viscous", "stiffness", "attraction", "pid"])
def test_a_run_needs_a_figure(key):
    with pytest.raises(ConfigError, match=f"axes.x.*{key}: is unknown") as error:
        parse_machine(with_unknown(key), "M.yaml")
    assert str(error.value).startswith("M.yaml:")
    assert len(str(error.value).splitlines()) == 1


def test_a_diagnosis_gets_a_machine_that_can_move():
    text = with_unknown("pid")
    for key in ("mass", "coulomb", "stiffness", "attraction", "static_ratio"):
        text = with_unknown(key, text)
    machine = parse_machine(text, "M.yaml", fitted=True)
    assert set(machine.unknown) == {"x"}
    assert set(machine.unknown["x"]) == {
        "mass", "coulomb", "stiffness", "attraction", "static_ratio", "gains"
    }  # fmt: skip
    x, drive = machine.axes["x"].plant, machine.axes["x"].drive
    assert x.mass * machine.axes["x"].limits.acceleration < drive.peak_force
    assert x.friction.coulomb < drive.peak_force
    assert stage_settings(machine).axes[0].mass == x.mass
    assert machine.axes["y"] == load_machine(None).axes["y"]


CASCADE = "{position_gain: 100.0, velocity_gain: 2000.0, derivative_time: 1e-4}"


def test_friction_may_be_unknown_as_a_whole():
    text = load_machine(None).text.replace("&", "")
    begin = text.index("      friction:")
    end = text.index("  y:")
    whole = text[:begin] + "      friction: unknown\n" + text[end:]
    x = parse_machine(whole, "M.yaml", fitted=True)
    assert set(x.unknown["x"]) == {
        "coulomb", "viscous", "static_ratio", "stribeck_velocity", "stiffness", "attraction"
    }  # fmt: skip
    assert stage_settings(x).axes[0].friction.elements == 4
    with pytest.raises(ConfigError, match=r"friction\.coulomb: is unknown; only `gap diagnose`"):
        parse_machine(whole, "M.yaml")


def test_gains_may_be_unknown_where_no_loop_is_simulated():
    unknown = with_unknown("pid")
    assert parse_machine(unknown, "M.yaml", gains=False).unknown == {"x": ("gains",)}
    with pytest.raises(ConfigError, match=r"mass: is unknown"):
        parse_machine(with_unknown("mass", unknown), "M.yaml", gains=False)


@pytest.mark.parametrize(
    ("text", "cascade"),
    [(TEXT, "unknown"), (with_unknown("pid"), "unknown"), (with_unknown("pid"), CASCADE)],
)
def test_gains_beside_unknown_ones_are_refused(text, cascade):
    both = text.replace("rated_force:", f"cascade: {cascade}\n      rated_force:", 1)
    with pytest.raises(ConfigError, match=r"axes\.x\.drive\.cascade: cannot be combined with pid"):
        parse_machine(both, "M.yaml", fitted=True)


def test_elsewhere_it_is_a_word_like_any_other():
    with pytest.raises(ConfigError, match="rated_force"):
        parse_machine(with_unknown("rated_force"), "M.yaml", fitted=True)
