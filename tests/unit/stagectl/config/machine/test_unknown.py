"""What a machine file leaves unknown: found by a diagnosis, refused by everything else."""

import pytest

from stagectl.config import load_machine, parse_machine, stage_settings
from stagectl.errors import ConfigError


@pytest.fixture
def text():
    return load_machine(None).text


def with_unknown(text, key, axis=0):
    """The machine file with the value of a key of one axis unknown."""
    lines = text.splitlines()
    found = [i for i, line in enumerate(lines) if line.strip().startswith(f"{key}:")]
    at = found[axis]
    lines[at] = lines[at].split(":")[0] + ": unknown"
    return "\n".join(lines)


@pytest.mark.parametrize("key", ["mass", "coulomb", "viscous", "stiffness", "attraction", "pid"])
def test_a_run_needs_a_figure(text, key):
    with pytest.raises(ConfigError, match=f"axes.x.*{key}: is unknown") as error:
        parse_machine(with_unknown(text, key), "M.yaml")
    assert str(error.value).startswith("M.yaml:")
    assert len(str(error.value).splitlines()) == 1


def test_a_diagnosis_gets_a_machine_that_can_move(text):
    for key in ("mass", "coulomb", "stiffness", "attraction", "static_ratio"):
        text = with_unknown(text, key)
    machine = parse_machine(with_unknown(text, "pid"), "M.yaml", fitted=True)
    assert set(machine.unknown) == {"x"}
    assert set(machine.unknown["x"]) == {
        "mass", "coulomb", "stiffness", "attraction", "static_ratio", "gains"
    }  # fmt: skip
    x, drive = machine.axes["x"].plant, machine.axes["x"].drive
    assert x.mass * machine.axes["x"].limits.acceleration < drive.peak_force
    assert x.friction.coulomb < drive.peak_force
    assert stage_settings(machine).axes[0].mass == x.mass
    assert machine.axes["y"] == load_machine(None).axes["y"]


@pytest.mark.parametrize(
    ("pid", "cascade"),
    [
        (None, "unknown"),
        ("unknown", "unknown"),
        ("unknown", "{position_gain: 100.0, velocity_gain: 2000.0, derivative_time: 1e-4}"),
    ],
)
def test_gains_beside_unknown_ones_are_refused(text, pid, cascade):
    if pid is not None:
        text = with_unknown(text, "pid")
    lines = text.splitlines()
    at = next(i for i, line in enumerate(lines) if line.strip().startswith("rated_force:"))
    indent = lines[at][: len(lines[at]) - len(lines[at].lstrip())]
    lines.insert(at, f"{indent}cascade: {cascade}")
    with pytest.raises(ConfigError, match=r"axes\.x\.drive\.cascade: cannot be combined with pid"):
        parse_machine("\n".join(lines), "M.yaml", fitted=True)


def test_elsewhere_it_is_a_word_like_any_other(text):
    with pytest.raises(ConfigError, match="rated_force"):
        parse_machine(with_unknown(text, "rated_force"), "M.yaml", fitted=True)
