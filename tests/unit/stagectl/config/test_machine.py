"""Machine files: the packaged one is read exactly, and every bad one says where and why."""

from __future__ import annotations

import pickle
from pathlib import Path

import pytest

from stagectl.config import load_machine, parse_machine
from stagectl.errors import ConfigError

GOOD = load_machine().text


def problems(text: str) -> tuple[str, ...]:
    with pytest.raises(ConfigError) as caught:
        parse_machine(text, "m.yaml")
    assert all("\n" not in line for line in caught.value.problems)
    assert str(caught.value) == "\n".join(caught.value.problems)
    assert caught.value.exit_code == 2
    return caught.value.problems


def changed(old: str, new: str) -> str:
    """The packaged machine with the first `old` (that of axis x) replaced."""
    assert old in GOOD
    return GOOD.replace(old, new, 1)


def test_the_packaged_machine() -> None:
    machine = load_machine()
    x, y = machine.axes["x"], machine.axes["y"]
    assert machine.name == "wafer-xy"
    assert list(machine.axes) == ["x", "y"]
    assert machine.bus.sync_period == 1e-3
    assert (x.node, x.travel, x.limits.jerk) == (1, (-0.15, 0.15), 2000.0)
    assert x.encoder.increment == 1e-9
    assert y.drive.pid.ki == 28130000.0
    assert y.plant.friction.attraction == 900.0
    assert x.plant.friction.repeatability.correlation_time == 0.5
    assert x.effects == ()
    assert "docs/reference-stage.md" in machine.text


def test_text_and_source_are_kept_as_read(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_bytes(GOOD.replace("\n", "\r\n").encode())
    machine = load_machine(path)
    assert machine.text == GOOD.replace("\n", "\r\n")
    assert machine.source == str(path)


def test_units_mean_the_same_as_si_figures() -> None:
    text = changed("stiffness: 6.0e5", "stiffness: 0.6 N/um").replace(
        "sync_period: 0.001", "sync_period: 1 ms"
    )
    assert parse_machine(text, "m").axes == load_machine().axes


def test_effects_are_kept_as_names_and_figures() -> None:
    text = changed("node: 1", "node: 1\n    effects: [{effect: cogging, amplitude: 1.2, phase: 0}]")
    ((name, figures),) = parse_machine(text, "m").axes["x"].effects
    assert name == "cogging"
    assert figures == {"amplitude": 1.2, "phase": 0.0}


@pytest.mark.parametrize(
    ("old", "new", "key_and_reason"),
    [
        (
            "mass: 8.0",
            "^mas: 8.0",
            "axes.x.plant.mas: unknown key; did you mean 'mass'?",
        ),
        ("mass: 8.0", "mass: ^-8.0", "axes.x.plant.mass: must be > 0, is -8"),
        (
            "mass: 8.0",
            "mass: ^8 mm",
            "axes.x.plant.mass: must be a mass (SI, or a text such as '8 kg'), "
            "but '8 mm' is a length",
        ),
        (
            "mass: 8.0",
            "mass: ^.nan",
            "axes.x.plant.mass: must be a finite number, is .nan",
        ),
        (
            "mass: 8.0",
            "mass: ^on",
            "axes.x.plant.mass: must be a mass (SI, or a text such as '8 kg'), is 'on'",
        ),
        (
            "mass: 8.0",
            "mass: 8.0\n      ^mass: 9.0",
            "axes.x.plant.mass: duplicate key (first at line ",
        ),
        (
            "mass: 8.0",
            "mass: ^[8.0]",
            "axes.x.plant.mass: must be a mass (SI, or a text such as '8 kg'), is a list",
        ),
        ("node: 1", "node: ^1.0", "axes.x.node: must be a whole number, is 1"),
        ("node: 1", "node: ^true", "axes.x.node: must be a whole number, is true"),
        ("node: 1", "node: ^0", "axes.x.node: must be >= 1, is 0"),
        ("node: 1", "node: ^127", "axes.x.node: 127 is the host's own node id"),
        ("node: 1", "node: 2", "axes.y.node: 2 is the node of axis x already"),
        (
            "travel: [-0.15, 0.15]",
            "travel: ^[0.15, -0.15]",
            "axes.x.travel: must be [lowest, highest], is [0.15, -0.15]",
        ),
        (
            "travel: [-0.15, 0.15]",
            "travel: ^[-150, 150]",
            "axes.x.travel: beyond +-2.147 m, the range of a position in 1 nm "
            "(drive.position_unit)",
        ),
        (
            "travel: [-0.15, 0.15]",
            "travel: ^[0.15]",
            "axes.x.travel: must be a list of two, is 1 items",
        ),
        (
            "travel: [-0.15, 0.15]",
            "travel: ^0.15",
            "axes.x.travel: must be a list of two, is 0.15",
        ),
        (
            "control_period: 1.0e-4",
            "control_period: ^3.0e-4",
            "axes.x.drive.control_period: must divide bus.sync_period (0.001 s), is 0.0003 s",
        ),
        (
            "control_period: 1.0e-4",
            "control_period: 2.0e-4",
            "axes.y.drive.control_period: must be the same on all axes",
        ),
        (
            "peak_force: 120.0",
            "peak_force: ^12.0",
            "axes.x.drive.peak_force: must be at least rated_force",
        ),
        (
            "static_ratio: 0.40",
            "static_ratio: ^-1",
            "axes.x.plant.friction.static_ratio: must be > -1, is -1",
        ),
        (
            "model: gms",
            "model: ^lugre",
            "axes.x.plant.friction.model: must be 'gms', is 'lugre'",
        ),
        (
            "elements: 10",
            "elements: ^0",
            "axes.x.plant.friction.elements: must be >= 1, is 0",
        ),
        (
            "sync_period: 0.001",
            "sync_period: ^1.0e+30",
            "bus.sync_period: must be <= 1, is 1e+30",
        ),
        (
            "acceleration: 10.0",
            "acceleration: ^1.0e+30",
            "axes.x.limits.acceleration: beyond 4295 m/s^2, the range of 1 um/s^2 steps "
            "(drive.acceleration_unit)",
        ),
        (
            "following_error: 0.001",
            "following_error: ^4.2949672950",
            "axes.x.limits.following_error: beyond 4.295 m, the range of 1 nm steps "
            "(drive.position_unit)",
        ),
        (
            "mass: 8.0",
            "mass: ^1.0e+300",
            "axes.x.plant.mass: must be at most 1e+09 kg, is 1e+300",
        ),
        (
            "current_bandwidth: 1500.0",
            "current_bandwidth: ^1.0e-300",
            "axes.x.drive.current_bandwidth: must be at least 0.001 Hz, is 1e-300",
        ),
        (
            "repeatability: {coulomb: 0.01",
            "repeatability: {coulomb: ^7.0",
            "axes.x.plant.friction.repeatability.coulomb: must be at most 1, is 7",
        ),
        (
            "following_error: 0.001",
            "following_error: ^1.0e-12",
            "axes.x.limits.following_error: 1e-12 m is nothing in 1 nm steps (drive.position_unit)",
        ),
        (
            "node: 1",
            "node: 1\n    homing: {velocity: 0.01, index_velocity: ^1.0e-10}",
            "axes.x.homing.index_velocity: 1e-10 m/s is nothing in 1 nm/s steps "
            "(drive.position_unit)",
        ),
        (
            "node: 1",
            "node: 1\n    homing: {velocity: ^1.0e-8}",
            "axes.x.homing.velocity: at 1e-08 m/s the travel there and back takes 694 days",
        ),
        (
            "node: 1",
            "node: 1\n    homing: {index_velocity: ^1.0e+300}",
            "axes.x.homing.index_velocity: must be at most 1e+06 m/s, is 1e+300",
        ),
        ("  x:\n", "  ^'x y':\n", "axes.x y: must be a word of at most 32 letters, digits and _"),
        (
            "interface: virtual",
            "interface:^",
            "bus.interface: must be a text, is empty",
        ),
        (
            "limits: {velocity: 1.0, acceleration: 10.0, jerk: 2000.0, following_error: 0.001}",
            "limits: ^[1.0, 10.0]",
            "axes.x.limits: must be a mapping (key: value), is a list",
        ),
        (
            "encoder: {increment: 1.0e-9, noise: 1.0e-9}",
            "encoder: ^{increment: 1.0e-9}",
            "axes.x.encoder.noise: is missing",
        ),
        (
            "node: 1",
            "node: 1\n    effects: [^{effect: cogging, amplitude: big}]",
            "axes.x.effects[1]: cogging: amplitude must be a number (SI), is 'big'",
        ),
        (
            "node: 1",
            "node: 1\n    effects: [^{amplitude: 1}]",
            "axes.x.effects[1]: needs the key effect with the effect's name",
        ),
        (
            "rated_force: 40.0",
            "rated_force: 40.0\n      enable_timeout: ^0",
            "axes.x.drive.enable_timeout: must be > 0, is 0",
        ),
        (
            "rated_force: 40.0",
            "rated_force: 40.0\n      boot_timeout: ^1 um",
            "axes.x.drive.boot_timeout: must be a time",
        ),
        (
            "rated_force: 40.0",
            "rated_force: 40.0\n      enable_timeout: ^3600",
            "axes.x.drive.enable_timeout: must be at most 600 s, is 3600",
        ),
        (
            "rated_force: 40.0",
            "rated_force: 40.0\n      revision: ^65536",
            "axes.x.drive.revision: must be",
        ),
        (
            "node: 1",
            "node: 1\n    effects: ^cogging",
            "axes.x.effects: must be a list, is 'cogging'",
        ),
    ],
)
def test_each_fault_is_one_line_at_its_place(old: str, new: str, key_and_reason: str) -> None:
    """`^` in the new text marks the place that the problem should name."""
    text = changed(old, new)
    (found,) = problems(text.replace("^", ""))
    if "^" in text:
        before = text[: text.index("^")]
        place = f"{before.count(chr(10)) + 1}:{len(before) - before.rfind(chr(10))}"
        assert found.startswith(f"m.yaml:{place}: {key_and_reason}")
    else:
        assert key_and_reason in found


def test_all_problems_come_at_once_in_the_order_of_the_file() -> None:
    text = (
        GOOD.replace("bitrate: 1000000", "bitrate: fast")
        .replace("mass: 8.0", "mass: .inf")
        .replace("mass: 14.0", "")
        .replace("node: 2", "nodes: 2")
    )
    keys = [line.split(": ")[1] for line in problems(text)]
    assert keys[:2] == ["bus.bitrate", "axes.x.plant.mass"]
    assert set(keys[2:]) == {"axes.y.nodes", "axes.y.plant.mass"}


@pytest.mark.parametrize("text", ["[]", "just text", "3", "machine: a"])
def test_a_file_that_is_no_machine_at_all(text: str) -> None:
    assert all(line.startswith("m.yaml:1:1: ") for line in problems(text))


def test_a_missing_file_a_directory_and_an_empty_file(tmp_path: Path) -> None:
    empty = tmp_path / "empty.yaml"
    empty.touch()
    for path, reason in {
        tmp_path / "no.yaml": ": no such file",
        tmp_path: ": is a directory, not a file",
        empty: ":1:1: is empty",
    }.items():
        with pytest.raises(ConfigError) as caught:
            load_machine(path)
        assert caught.value.problems == (f"{path}{reason}",)


def test_a_machine_survives_pickling() -> None:
    machine = load_machine()
    assert pickle.loads(pickle.dumps(machine)).text == machine.text  # noqa: S301 - our own
    assert pickle.loads(pickle.dumps(machine)) == machine  # noqa: S301 - our own


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("mass: 8.0", "mass: 5 g"),  # a piezo stage's carriage
        ("mass: 8.0", "mass: 2.0e+4"),  # a gantry
        ("coulomb: 6.0", "coulomb: 1.0e-6"),  # an air bearing
        ("viscous: 20.0", "viscous: 0.0"),
        ("increment: 1.0e-9", "increment: 1.0e-12"),  # an interferometer
        ("increment: 1.0e-9", "increment: 50 um"),
        ("current_bandwidth: 1500.0", "current_bandwidth: 10 kHz"),
        ("control_period: 1.0e-4", "control_period: 6.25e-5"),
        ("node: 1", "node: 1\n    homing: {velocity: 100 um/s, index_velocity: 1 um/s}"),
        ("correlation_time: 0.5", "correlation_time: 1.0e+6"),
    ],
)
def test_what_a_stage_may_have_is_taken(old: str, new: str) -> None:
    parse_machine(GOOD.replace(old, new), "m")
