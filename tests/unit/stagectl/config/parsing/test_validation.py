"""Each value of a file that is refused is one line at its place."""

from __future__ import annotations

import pytest

from stagectl.config import load_machine, parse_machine
from stagectl.errors import ConfigError

GOOD = load_machine().text


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
            "static_ratio: 0.40",
            "static_ratio: ^-1",
            "axes.x.plant.friction.static_ratio: must be > -1, is -1",
        ),
        (
            "model: gms",
            "model: ^lugre",
            "axes.x.plant.friction.model: must be 'gms' or 'coulomb', is 'lugre'",
        ),
        (
            "rated_force: 40.0",
            "rated_force: 40.0\n      options: {^quickstop: 2}",
            "axes.x.drive.options.quickstop: unknown key; did you mean 'quick_stop'?",
        ),
        (
            "rated_force: 40.0",
            "rated_force: 40.0\n      quirks: {offset_delay: ^'3'}",
            "axes.x.drive.quirks.offset_delay: must be a whole number, is '3'",
        ),
        (
            "rated_force: 40.0",
            "rated_force: 40.0\n      quirks: {offset_step: ^1.5}",
            "axes.x.drive.quirks.offset_step: must be <= 1, is 1.5",
        ),
        (
            "rated_force: 40.0",
            "rated_force: 40.0\n      quirks: {position_filter: ^2 s}",
            "axes.x.drive.quirks.position_filter: must be <= 1, is '2 s'",
        ),
        (
            "rated_force: 40.0",
            "rated_force: 40.0\n      quirks: ^late",
            "axes.x.drive.quirks: must be a mapping (key: value), is 'late'",
        ),
        (
            "sync_period: 0.001",
            "sync_period: 0.001\n  realtime: {core: ^1.0}",
            "bus.realtime.core: must be a whole number, is 1",
        ),
        (
            "sync_period: 0.001",
            "sync_period: 0.001\n  realtime: {lock_memory: ^1}",
            "bus.realtime.lock_memory: ",
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
def test_each_refused_value_is_one_line_at_its_place(
    check_refused, old: str, new: str, key_and_reason: str
) -> None:
    check_refused(old, new, key_and_reason)


def test_all_problems_come_at_once_in_the_order_of_the_file(problems_of) -> None:
    text = (
        GOOD.replace("bitrate: 1000000", "bitrate: fast")
        .replace("mass: 8.0", "mass: .inf")
        .replace("mass: 14.0", "")
        .replace("node: 2", "nodes: 2")
    )
    keys = [line.split(": ")[1] for line in problems_of(text)]
    assert keys[:2] == ["bus.bitrate", "axes.x.plant.mass"]
    assert set(keys[2:]) == {"axes.y.nodes", "axes.y.plant.mass"}


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (
            "# c\ncalibrate: nine\nsites: []\n",
            "x.yaml:2:1: is a calibration file, not a machine file",
        ),
        ("faults: []\n", "x.yaml:1:1: is a faults file, not a machine file"),
    ],
)
def test_a_file_of_another_kind_is_refused_in_one_line(text: str, reason: str) -> None:
    with pytest.raises(ConfigError) as refusal:
        parse_machine(text, "x.yaml")
    assert str(refusal.value) == reason
