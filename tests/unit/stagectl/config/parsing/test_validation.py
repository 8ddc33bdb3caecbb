"""Each value of a file that is refused is one line at its place."""

import pytest

from stagectl.config import load_machine, parse_machine
from stagectl.errors import ConfigError

GOOD = load_machine().text


@pytest.mark.parametrize(
    ("new", "key_and_reason"),
    [
        ("mass -> ^mas: 8.0", ".plant.mas: unknown key; did you mean 'mass'?"),
        ("mass: ^-8.0", ".plant.mass: must be > 0, is -8"),
        ("mass: ^8 mm", ".plant.mass: must be a mass (SI, or a text such as '8 kg'), but '8 mm'"),
        ("node: ^1.0", ".node: must be a whole number, is 1"),
        ("node: ^true", ".node: must be a whole number, is true"),
        ("node: ^0", ".node: must be >= 1, is 0"),
        ("travel: ^[0.15]", ".travel: must be a list of two, is 1 items"),
        ("travel: ^0.15", ".travel: must be a list of two, is 0.15"),
        ("static_ratio: ^-1", ".plant.friction.static_ratio: must be > -1, is -1"),
        ("model: ^lugre", ".plant.friction.model: must be 'gms' or 'coulomb', is 'lugre'"),
        ("quirks: {offset_delay: ^'3'}", ".drive.quirks.offset_delay: must be a whole number, is"),
        ("quirks: {offset_step: ^1.5}", ".drive.quirks.offset_step: must be <= 1, is 1.5"),
        (
            "quirks: {position_filter: ^2 s}",
            ".drive.quirks.position_filter: must be <= 1, is '2 s'",
        ),
        ("realtime: {lock_memory: ^1}", "bus.realtime.lock_memory: "),
        ("elements: ^0", ".plant.friction.elements: must be >= 1, is 0"),
        ("sync_period: ^1.0e+30", "bus.sync_period: must be <= 1, is 1e+30"),
        ("interface:^", "bus.interface: must be a text, is empty"),
        ("limits: ^[1.0, 10.0]", ".limits: must be a mapping (key: value), is a list"),
        ("encoder: ^{increment: 1.0e-9}", ".encoder.noise: is missing"),
        ("enable_timeout: ^0", ".drive.enable_timeout: must be > 0, is 0"),
        ("boot_timeout: ^1 um", ".drive.boot_timeout: must be a time"),
        ("revision: ^65536", ".drive.revision: must be"),
        (
            "options: {quick_stop: ^4}",
            ".drive.options.quick_stop: must be 0, 1, 2, 3, 5, 6, 7 or 8",
        ),
        ("options: {abort_connection: ^0}", ".drive.options.abort_connection: must be 1, 2 or 3,"),
        ("effects: ^cogging", ".effects: must be a list, is 'cogging'"),
    ],
)
def test_each_refused_value_is_one_line_at_its_place(check_refused, new, key_and_reason):
    check_refused(new, key_and_reason)


def test_an_axis_has_a_word_for_a_name(problems_of):
    (found,) = problems_of(GOOD.replace("  x:\n", "  'x y':\n", 1))
    assert found.startswith("m.yaml:10:3: axes.x y: must be a word of at most 32 letters, digits")


def test_all_problems_come_at_once_in_the_order_of_the_file(problems_of):
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
        ("# c\ncalibrate: nine\nsites: []\n", "2:1: is a calibration"),
        ("faults: []\n", "1:1: is a faults"),
    ],
)
def test_a_file_of_another_kind_is_refused_in_one_line(text, reason):
    with pytest.raises(ConfigError) as refusal:
        parse_machine(text, "x.yaml")
    assert str(refusal.value) == f"x.yaml:{reason} file, not a machine file"
